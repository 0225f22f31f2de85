"""The command line: words in, words and JSON out."""

import io
import logging
import os
import sys

from app.cli.commands import app
from app.cli.errors import error_text, is_expected
from app.log import start_log

_log = logging.getLogger(__name__)


def run() -> None:
    """Run the command that `sys.argv` names, and exit with its code.

    0 done; 1 could not do it, as for a value that cannot be, one line on stderr; 2 wrong usage, as for an
    option that is none; 130 interrupted.
    """
    for stream in (sys.stdout, sys.stderr):
        _use_utf8(stream)
    start_log("command")
    try:
        app()
    except Exception as error:
        _log.log(logging.INFO if is_expected(error) else logging.ERROR, "failed", exc_info=True)
        if os.environ.get("SLIPSTAND_DEBUG"):
            raise
        sys.stderr.write(f"error: {error_text(error)}\n")
        sys.exit(1)


def _use_utf8(stream: object) -> None:
    """Write files and pipes in UTF-8: Windows would use its code page, which has no Greek letters.

    A terminal keeps its encoding, and PYTHONIOENCODING is followed.
    """
    if isinstance(stream, io.TextIOWrapper):
        is_chosen = stream.isatty() or bool(os.environ.get("PYTHONIOENCODING"))
        # Names of files may be no text: `\\udcff` is, and is JSON too.
        stream.reconfigure(encoding=None if is_chosen else "utf-8", errors="backslashreplace")
