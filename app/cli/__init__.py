"""The command line: words in, words and JSON out."""

import os
import sys


def run() -> None:
    """Run the command that `sys.argv` names, and exit with its code.

    0 done; 1 could not do it, one line on stderr; 2 wrong usage; 130 interrupted.
    """
    from app.cli.commands import app
    from app.cli.errors import UsageError, explain

    try:
        app()
    except Exception as error:
        if os.environ.get("SLIPSTAND_DEBUG"):
            raise
        sys.stderr.write(f"error: {explain(error)}\n")
        sys.exit(2 if isinstance(error, UsageError) else 1)
