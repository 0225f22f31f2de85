"""The command line: words in, words and JSON out."""

import codecs
import io
import logging
import os
import sys

from app.cli.commands import app
from app.cli.errors import error_text, is_expected
from app.interrupts import was_interrupted
from app.log import start_log
from messages.control_characters import show_control_characters

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
        app(prog_name="slipstand")
    except SystemExit as ended:
        of_typer = getattr(ended.__context__, "__cause__", None)
        if was_interrupted() or isinstance(of_typer, KeyboardInterrupt):
            raise KeyboardInterrupt from None
        raise
    except Exception as error:
        if was_interrupted():
            raise KeyboardInterrupt from None
        _log.log(logging.INFO if is_expected(error) else logging.ERROR, "failed", exc_info=True)
        if os.environ.get("SLIPSTAND_DEBUG"):
            raise
        sys.stderr.write(f"error: {show_control_characters(error_text(error))}\n")
        sys.exit(1)


def _use_utf8(stream: object) -> None:
    """Write files and pipes in UTF-8: Windows would use its code page, which has no Greek letters.

    A terminal keeps its encoding, and PYTHONIOENCODING is followed. Where the locale is named C or POSIX a
    terminal is shown ASCII; Python would write UTF-8.
    """
    if isinstance(stream, io.TextIOWrapper):
        if os.environ.get("PYTHONIOENCODING"):
            encoding = None
        elif stream.isatty():
            encoding = "ascii" if _locale_name() in ("C", "POSIX") else None
        else:
            encoding = "utf-8"
        stream.reconfigure(encoding=encoding, errors=_SPELLED)


def _locale_name() -> str:
    """Name of the locale of characters, as the user's environment has it; "" where it has none."""
    return next(filter(None, map(os.environ.get, ("LC_ALL", "LC_CTYPE", "LANG"))), None) or ""


_SPELLED = "slipstand-spelled"  # how `codecs` calls `_spell`
_SPELLINGS = {
    "±": "+-", "µ": "u", "²": "^2", "³": "^3", "×": "x", "·": "*", "°": "deg ", "–": "-", "−": "-",
    "≥": ">=", "≤": "<=", "→": "->", "…": "...", "\u00a0": " ", "\u202f": " ",
}  # fmt: skip
"""Of signs that a terminal may lack."""


def _spell(error: UnicodeError) -> tuple[str, int]:
    """Spell what an encoding lacks: signs, and names of files that are no text, which JSON spells alike."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    missing = error.object[error.start : error.end]
    spelled = (_SPELLINGS.get(sign) or sign.encode("ascii", "backslashreplace").decode() for sign in missing)
    return "".join(spelled), error.end


codecs.register_error(_SPELLED, _spell)
