"""Entry point of `slipstand`: the desktop without a command, else the command line."""

import os
import sys

from app.child import ONE_THREAD
from app.interrupts import EXIT_CODE, LINE, follow_interrupts, ignore_interrupts
from app.optional_imports import claim_process

_RUN_SUFFIX = ".h5"
_COMPLETION = "_SLIPSTAND_COMPLETE"  # set by a shell that asks for the next word of a command


def main() -> None:
    """Run what the arguments ask for, and end with 130 and one line if it is interrupted."""
    follow_interrupts()
    try:
        _run()
    except KeyboardInterrupt:
        sys.stderr.write(LINE)
        sys.exit(EXIT_CODE)
    finally:
        ignore_interrupts()


def _run() -> None:
    """Run what the arguments ask for. Nothing heavy is imported before it is known to be needed."""
    arguments = sys.argv[1:]
    claim_process()
    for name, count in ONE_THREAD.items():
        os.environ.setdefault(name, count)
    if getattr(sys, "frozen", False):
        _keep_caches_apart()
        arguments = _run_if_child(arguments)
    if arguments == ["--version"]:
        from app.version import version_text

        sys.stdout.write(f"slipstand {version_text()}\n")
    elif _COMPLETION not in os.environ and arguments in ([], ["--simulated"]):
        _run_window(simulated=bool(arguments))
    elif len(arguments) == 1 and arguments[0].lower().endswith(_RUN_SUFFIX):
        _run_window(run=arguments[0])
    else:
        from app.cli import run

        run()


def _run_window(simulated: bool = False, run: str = "") -> None:
    """Open the window and exit; say it in one line where the system lacks what Qt needs."""
    try:
        from app.qt.main import run_window
    except ModuleNotFoundError:
        raise
    except ImportError as error:  # a shared library
        sys.stderr.write(
            f"error: there is no window here: {error}. Install what Qt needs, on Debian and Ubuntu: "
            "apt-get install libegl1 libgl1 libopengl0. The commands need none of it: slipstand --help\n"
        )
        sys.exit(1)
    sys.exit(run_window(simulated=simulated, run=run))


def _keep_caches_apart() -> None:
    """Let numba keep what it compiles, and matplotlib its list of fonts, in a folder of ours.

    It would be that of the program or, where that cannot be written, one that all programs share.
    """
    import platformdirs

    folder = platformdirs.user_cache_path("slipstand", appauthor=False)
    os.environ.setdefault("NUMBA_CACHE_DIR", str(folder / "compiled"))
    os.environ.setdefault("MPLCONFIGDIR", str(folder / "matplotlib"))


def _run_if_child(arguments: list[str]) -> list[str]:
    """Run what a parent of the same frozen build asks for, and exit; else return the arguments."""
    import multiprocessing

    from app.child import run_child
    from app.child_process import CHILD_OPTION

    multiprocessing.freeze_support()
    if arguments[:1] == [CHILD_OPTION]:
        run_child(*arguments[1:])
    return arguments


if __name__ == "__main__":
    main()
