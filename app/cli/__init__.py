"""The command line: words in, words and JSON out."""

import os
import sys


def run() -> None:
    """Run the command that `sys.argv` names, and exit with its code.

    0 done; 1 could not do it, one line on stderr; 2 wrong usage; 130 interrupted.
    """
    from app.cli.commands import app

    try:
        app()
    except Exception as error:
        if os.environ.get("SLIPSTAND_DEBUG"):
            raise
        sys.stderr.write(f"error: {_one_line(error)}\n")
        sys.exit(1)


def _one_line(error: Exception) -> str:
    """Say what happened; a fault of the program itself is called one."""
    from app.cli.errors import is_expected

    said = " ".join(str(error).split())
    if is_expected(error):
        return said
    return (
        f"Slipstand itself failed ({type(error).__name__}: {said}). "
        "Set SLIPSTAND_DEBUG=1, run it again and report what it prints"
    )
