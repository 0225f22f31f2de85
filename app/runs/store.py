"""Writes a whole run at once: imported, simulated."""

import os
from pathlib import Path

from app.runs.disk import storage_error
from app.runs.layout import BlockLayout, RunBlock, StoredRun
from app.runs.metadata import EndMetadata, RunMetadata
from app.runs.writer import create_run


def write_run(
    path: Path, metadata: RunMetadata, block: RunBlock, ending: EndMetadata, *, replace: bool = False
) -> StoredRun:
    """Write a closed run file, or none.

    Parameters
    ----------
    path
        Must not exist yet, unless `replace`.

    Raises
    ------
    RunExistsError, MetadataError, DiskFullError, WriteError
    """
    path = path.absolute()
    made = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}") if replace else path
    writer = create_run(made, metadata, BlockLayout.of(block))
    try:
        writer.append(block)
        stored = writer.close(ending)
        if replace:
            made.replace(path)
    except OSError as error:
        made.unlink(missing_ok=True)
        raise storage_error(path, error) from None
    except BaseException:
        made.unlink(missing_ok=True)
        raise
    return StoredRun(str(path), stored.samples, stored.raw_bytes_stored)
