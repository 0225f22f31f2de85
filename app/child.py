"""What runs in a child process: `python -m app.child MODULE [ARGUMENT ...]`."""

import gc
import importlib
import sys
from typing import NoReturn


def run_child(module: str, *arguments: str) -> NoReturn:
    """Import a module of the program, call its `main`, and exit with what that returns.

    What imports make stays until the end. It is left out of garbage collections, which would take a third of
    the processor time of a short recording, most of it at the end.
    """
    sys.argv = [module, *arguments]
    gc.disable()
    main = importlib.import_module(module).main
    gc.freeze()
    gc.enable()
    try:
        sys.exit(main())
    finally:
        gc.freeze()


if __name__ == "__main__":
    run_child(*sys.argv[1:])
