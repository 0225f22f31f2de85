"""The one place of the version number, and of the commit that a program was made of."""

import contextlib
import functools
import json
from pathlib import Path

__version__ = "0.1.0"

_GIT_S = 5.0
_DIGITS = 12  # of a commit


@functools.cache
def commit() -> str:
    """Commit of the running source, with "-dirty" where files were changed since; "" where it is not known.

    That of a checkout, else that which was written when the package or the archive of the sources was made
    (`commit.txt`), else that of an installation from a repository (`direct_url.json` of PEP 610).
    """
    root = Path(__file__).resolve().parent.parent
    return (_of_checkout(root) if (root / ".git").exists() else "") or _written() or _of_installation()


def version_text() -> str:
    """Version and, in parentheses, the commit where it is known."""
    return f"{__version__} ({commit()})" if commit() else __version__


def _written() -> str:
    try:
        text = Path(__file__).with_name("commit.txt").read_text("utf-8").strip()
    except OSError:
        return ""
    if text.startswith("$"):  # a placeholder that only `git archive` fills in
        return ""
    return text[:_DIGITS] if text.isalnum() else text


def _of_checkout(root: Path) -> str:
    import subprocess  # commands that analyse nothing need neither of these modules

    described = [
        "git",
        "-C",
        str(root),
        "describe",
        "--always",
        "--dirty",
        "--exclude=*",
        f"--abbrev={_DIGITS}",
    ]
    flags = getattr(subprocess, "CREATE_NO_WINDOW", 0)  # Windows opens a console window otherwise
    with contextlib.suppress(OSError, subprocess.SubprocessError, UnicodeDecodeError):
        found = subprocess.run(
            described, capture_output=True, text=True, timeout=_GIT_S, check=True, creationflags=flags
        )
        return found.stdout.strip()
    return ""


def _of_installation() -> str:
    import importlib.metadata

    with contextlib.suppress(importlib.metadata.PackageNotFoundError, ValueError, KeyError, TypeError):
        text = importlib.metadata.distribution("slipstand").read_text("direct_url.json") or "{}"
        return str(json.loads(text)["vcs_info"]["commit_id"])
    return ""
