"""Where runs are kept."""

import os
from pathlib import Path

import platformdirs

import config
from config.files import is_checkout


def recordings_directory() -> Path:
    """Folder of the runs; it need not exist yet.

    `SLIPSTAND_RECORDINGS` if set; `recordings/` when run from a checkout; else `Slipstand/recordings`
    in the user's documents.
    """
    override = os.environ.get("SLIPSTAND_RECORDINGS")
    if override:
        return Path(override).expanduser().resolve()
    if is_checkout():
        return Path(config.__file__).resolve().parent.parent / "recordings"
    return Path(platformdirs.user_documents_dir()) / "Slipstand" / "recordings"
