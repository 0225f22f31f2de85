"""What runs in a child process: `python -m app.child MODULE [ARGUMENT ...]`."""

import contextlib
import gc
import importlib
import sys
from collections.abc import Iterator
from typing import NoReturn

from app.optional_imports import claim_process

ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)
"""Environment in which linear algebra starts no threads.

Small matrices gain nothing from them, and their start takes as long as the rest of numpy's import.
"""


@contextlib.contextmanager
def loading() -> Iterator[None]:
    """Leave all that exists, and what is loaded meanwhile, out of garbage collections for good.

    Collections take a third of the time in which the analysis is loaded, and find next to nothing.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


def run_child(module: str, *arguments: str) -> NoReturn:
    """Import a module of the program, call its `main`, and exit with what that returns."""
    sys.argv = [module, *arguments]
    claim_process()
    with loading():
        main = importlib.import_module(module).main
    try:
        sys.exit(main())
    finally:
        gc.freeze()  # collections at the exit would take as long as some imports


if __name__ == "__main__":
    run_child(*sys.argv[1:])
