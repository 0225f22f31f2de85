"""The log: one rotating file a kind of process, in the user's folder of logs. It holds no sample values."""

import contextlib
import logging
import logging.handlers
import os
import platform
import sys
from pathlib import Path

import platformdirs

from app.version import __version__

FOLDER_VARIABLE = "SLIPSTAND_LOGS"
LEVEL_VARIABLE = "SLIPSTAND_LOG_LEVEL"
LEVELS = ("error", "warning", "info", "debug")
_LARGEST_BYTES = 1_000_000
"""Some thousand lines: a day of recording at level debug."""
_KEPT = 2  # full files that are kept beside the newest
_FORMAT = "%(asctime)s %(levelname)s %(process)d %(name)s: %(message)s"

_log = logging.getLogger(__name__)


def log_folder() -> Path:
    """Folder of the logs: SLIPSTAND_LOGS, or the user's."""
    given = os.environ.get(FOLDER_VARIABLE)
    return Path(given) if given else platformdirs.user_log_path("slipstand", appauthor=False)


def start_log(kind: str, level: str | None = None, *, on_stderr: bool = False) -> None:
    """Write the log of this process to a file; the processes that it starts use the same level.

    Parameters
    ----------
    kind : str
        Kind of process, which names the file: "window", "engine".
    level : str, optional
        One of `LEVELS`; if absent, that of the process which started this one, or "info".
    on_stderr : bool
        Write it to stderr as well.
    """
    chosen = level or os.environ.get(LEVEL_VARIABLE, "info")
    chosen = chosen if chosen in LEVELS else "info"
    os.environ[LEVEL_VARIABLE] = chosen
    root = logging.getLogger()
    for handler in [handler for handler in root.handlers if handler.name == _NAME]:
        root.removeHandler(handler)
        handler.close()
    handlers: list[logging.Handler] = [logging.StreamHandler(sys.stderr)] if on_stderr else []
    with contextlib.suppress(OSError):  # a folder that cannot be made leaves the program without a log
        log_folder().mkdir(parents=True, exist_ok=True)
        handlers.append(
            logging.handlers.RotatingFileHandler(
                log_folder() / f"{kind}.log",
                maxBytes=_LARGEST_BYTES,
                backupCount=_KEPT,
                encoding="utf-8",
                delay=True,
            )
        )
    for handler in handlers:
        handler.name = _NAME
        handler.setFormatter(logging.Formatter(_FORMAT))
        root.addHandler(handler)
    logging.raiseExceptions = False  # a full disk must not disturb a recording
    root.setLevel(logging.WARNING)  # of libraries
    for package in ("app", "analysis", "config", "drivers"):
        logging.getLogger(_PREFIX + package).setLevel(chosen.upper())
    _log.info("%s of Slipstand %s starts, Python %s", kind, __version__, platform.python_version())


_NAME = "slipstand"
_PREFIX = __name__.removesuffix("app.log")
"""Of our packages: empty in a checkout, "slipstand." in an installation (setup.py)."""
