"""The command line: words in, words and JSON out."""

import os
import sys


def run() -> None:
    """Run the command that `sys.argv` names, and exit with its code.

    0 done; 1 could not do it, as for a value that cannot be, one line on stderr; 2 wrong usage, as for an
    option that is none; 130 interrupted.
    """
    from app.cli.commands import app
    from app.cli.errors import explain

    try:
        app()
    except Exception as error:
        if os.environ.get("SLIPSTAND_DEBUG"):
            raise
        sys.stderr.write(f"error: {explain(error)}\n")
        sys.exit(1)
