"""Files that appear whole or not at all, and never in place of another unless asked."""

import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from app.runs.disk import storage_error, sync_file, sync_folder


@contextmanager
def atomic_write(path: Path, *, replace: bool = False) -> Iterator[Path]:
    """Yield a path beside `path` to write to; what stands there at the end becomes `path`.

    Raises
    ------
    RunExistsError
        `path` exists, and `replace` was not asked for.
    DiskFullError, WriteError
        Nothing is left behind then.
    """
    made = path.with_name(f".{path.stem}.{uuid.uuid4().hex[:8]}{path.suffix}")
    claimed = False
    try:
        if not replace:
            path.open("x").close()  # nobody else can take the name meanwhile
            claimed = True
        yield made
        sync_file(made)
        made.replace(path)
        claimed = False
        sync_folder(path.parent)
    except OSError as error:
        raise storage_error(path, error) from None
    finally:
        made.unlink(missing_ok=True)
        if claimed:
            path.unlink(missing_ok=True)
