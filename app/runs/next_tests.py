"""What is to be recorded next in a folder of runs, kept there as `next-tests.json`."""

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self

import msgspec

from app.runs.disk import atomic_write, make_folder
from app.runs.errors import MetadataError
from app.runs.metadata import Conditions

if TYPE_CHECKING:
    from app.runs.summary import RunSummary

FILE_NAME = "next-tests.json"
REPEATS_MAX = 999
_GOOD_ENDS = ("rest", "enough", "duration")


class PlannedSeries(msgspec.Struct, frozen=True):
    """A series that is to be repeated so many times."""

    series: str
    repeats: Annotated[int, msgspec.Meta(ge=1, le=REPEATS_MAX)]


class NextTests(msgspec.Struct, frozen=True):
    """What the next tests are to be."""

    plan: tuple[PlannedSeries, ...] = ()
    series: str = ""
    operator: str = ""
    conditions: Conditions = Conditions()
    undecided: tuple[str, ...] = ()
    """Names of files of runs that the operator has neither kept nor moved to the trash."""

    def replace(self, **changes: Any) -> Self:
        return msgspec.structs.replace(self, **changes)


def load_next_tests(folder: Path) -> NextTests:
    """Read what was kept of a folder; nothing is planned where nothing was. Raises MetadataError."""
    path = folder / FILE_NAME
    try:
        return msgspec.json.decode(path.read_bytes(), type=NextTests)
    except FileNotFoundError:
        return NextTests()
    except (OSError, msgspec.MsgspecError, ValueError) as error:
        raise MetadataError(
            "{path}: cannot be used ({error}). Mend it, or put it aside to plan anew", path=path, error=error
        ) from None


def save_next_tests(folder: Path, tests: NextTests) -> None:
    """Keep it, all at once or not at all. Raises DiskFullError, WriteError."""
    make_folder(folder)
    with atomic_write(folder / FILE_NAME, replace=True) as made:
        made.write_bytes(msgspec.json.format(msgspec.json.encode(tests)) + b"\n")


def counts_as_done(run: "RunSummary", undecided: Collection[str] = ()) -> bool:
    """Tell whether a run counts as a test done: it was analysed and kept, or came to its end by itself.

    The latter is not enough for a run whose name is among the `undecided`.
    """
    is_complete = run.ended in _GOOD_ENDS and Path(run.path).name not in undecided
    return not run.fault and (run.analyses > 0 or is_complete)
