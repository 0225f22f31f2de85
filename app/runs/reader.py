"""Open run files: a frozen value with everything that an analysis or a plot needs."""

import contextlib
import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import h5py
import msgspec
import numpy as np
from numpy.typing import NDArray

from app.runs import metadata_io, schema
from app.runs.blocks import count_flags
from app.runs.columns import count_paths, read_column, signal_paths, stored_rows
from app.runs.errors import NotARunError, RunError, being_recorded, damaged, in_use, no_such_run, unreadable
from app.runs.lock import is_being_recorded
from app.runs.metadata import EndMetadata, Events, RunMetadata
from app.runs.metadata_io import Change
from app.runs.saved_analyses import SavedAnalysis, read_analyses
from app.runs.validator import Validator
from config.durable_files import is_in_use
from config.schema import Gauges
from drivers.samples import ABSENT_BY_GAUGE, Losses

T = TypeVar("T")
_HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"


@dataclass(frozen=True, eq=False, slots=True)
class Run:
    """A run as stored, with all edits applied."""

    path: Path
    identifier: str
    """UUID given when it was recorded."""
    metadata: RunMetadata  # with the latest value of every edited field
    end: EndMetadata | None  # None for a run that was never closed: its writer died
    time_s: NDArray[np.float64]
    """(n,) float64: since the first stored sample, on the device's or nominal clock."""
    table_reading: NDArray[np.float64]  # (n,) float64: gauge 1, in `metadata.unit`; NaN where absent
    relative_reading: NDArray[np.float64] | None
    """(n,) float64 or None: gauge 2, against table or base as its calibration says; None without one."""
    status: NDArray[np.uint8]  # (n,) uint8: `drivers.samples.SampleStatus` flags
    analyses: tuple[SavedAnalysis, ...]
    changes: tuple[Change, ...]

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def losses(self) -> Losses:
        """Statistics of the samples; those of an unfinished run are counted from its flags."""
        return self.end.losses if self.end else count_flags(self.status)

    @property
    def events(self) -> Events:
        return self.end.events if self.end else Events()


class Fingerprint(msgspec.Struct, frozen=True):
    """Hash, identifier and checksums of one run file."""

    name: str
    size_bytes: int
    sha256: str
    """Of the whole file. It changes with every analysis or edit that is added to the run."""
    identifier: str = ""
    columns: dict[str, str] = {}
    """CRC-32 of each column of samples, hexadecimal, as stored when the run was closed; never changes."""


def open_run(path: Path | str, *, validator: Validator | None = None, trusted: bool = False) -> Run:
    """Read a run. Raises RunNotFoundError, NotARunError, BeingRecordedError, DamagedRunError.

    `validator` validates the file first, in its own process; share one to open many runs, else one is
    started. A `trusted` file, which the caller wrote or checked, is read without validation.
    """
    return validate_and_read(path, _read, validator=validator, trusted=trusted)


def load_counts(run: Run) -> NDArray[np.int32] | NDArray[np.float64] | None:
    """Readings as received, (n, channels); None where there are none. Raises RunError."""

    def read(file: h5py.File) -> NDArray[np.int32] | NDArray[np.float64] | None:
        columns = [read_column(file[path], slice(len(run))) for path in count_paths(file)]
        return np.column_stack(columns) if columns else None

    return read_file(run.path, read)


def compute_fingerprint(path: Path) -> Fingerprint:
    """Compute the fingerprint of a validated run file. Raises RunError."""
    try:
        with path.open("rb") as opened:
            sha256 = hashlib.file_digest(opened, "sha256").hexdigest()
            size = opened.tell()
    except OSError as error:
        raise unreadable(path, error) from None

    def read(file: h5py.File) -> Fingerprint:
        stored = file.get(schema.CHECKSUMS, {}).items()
        columns = {name: f"{int(np.uint32(value[()])):08x}" for name, value in stored}
        return Fingerprint(path.name, size, sha256, metadata_io.read_identifier(file), columns)

    return read_file(path, read)


def validate_and_read(
    path: Path | str, read: Callable[[h5py.File], T], *, validator: Validator | None, trusted: bool = False
) -> T:
    """Validate a file, unless it is trusted, and read something of it. Raises like `open_run`."""
    path = Path(path).absolute()
    check_openable(path)
    if not trusted:
        with contextlib.nullcontext(validator) if validator else Validator.start() as active:
            active.validate(path)
    return read_file(path, read)


def check_openable(path: Path) -> None:
    """Refuse, without HDF5, what is visibly no closed or abandoned run. Raises RunError."""
    try:
        if path.is_dir():
            raise NotARunError("{path} is a folder. Give a run file in it", path=path)
        with path.open("rb") as file:
            signature = file.read(len(_HDF5_SIGNATURE))
    except FileNotFoundError:
        raise no_such_run(path) from None
    except OSError as error:
        raise unreadable(path, error) from None
    if is_being_recorded(path):
        raise being_recorded(path)
    if signature != _HDF5_SIGNATURE:
        raise NotARunError(
            "{path} is not an HDF5 file. Give a run file, or bring it in with `slipstand import`", path=path
        )


def read_file(path: Path, read: Callable[[h5py.File], T]) -> T:
    """Open a validated file, read, close. Any other error of HDF5 is damage. Raises RunError."""
    try:
        with h5py.File(path, "r", locking="best-effort") as file:
            return read(file)
    except BlockingIOError:
        raise being_recorded(path) from None
    except RunError:
        raise
    except (OSError, RuntimeError, ValueError, KeyError, TypeError, AttributeError, ArithmeticError) as error:
        if is_in_use(error, path):
            raise in_use(path) from None
        raise damaged(path, error) from None


def reading_columns(
    file: h5py.File, metadata: RunMetadata, changes: Sequence[Change]
) -> Callable[[slice], list[NDArray[np.float64]]]:
    """Return a function that reads some rows of each gauge: as stored, or by a later calibration."""
    if not _is_recalibrated(file, changes):
        signals = [file[path] for path in signal_paths(file)]
        return lambda rows: [read_column(column, rows) for column in signals]
    counts, status = [file[path] for path in count_paths(file)], file[schema.STATUS]
    gauges = (metadata.gauges.table, metadata.gauges.relative)

    def recalibrated(rows: slice) -> list[NDArray[np.float64]]:
        flags = read_column(status, rows)
        columns = zip(counts, gauges, ABSENT_BY_GAUGE, strict=False)
        return [
            np.where(
                (flags & absent) != 0,
                np.nan,
                gauge.displacement_m(read_column(column, rows).astype(np.float64)),
            )
            for column, gauge, absent in columns
        ]

    return recalibrated


def _read(file: h5py.File) -> Run:
    rows = slice(stored_rows(file))
    metadata = metadata_io.read_metadata(file)
    changes = tuple(metadata_io.read_changes(file))
    readings = reading_columns(file, metadata, changes)(rows)
    end = metadata_io.read_end_metadata(file)
    if end is not None and _is_recalibrated(file, changes):
        end = _recalibrate_end(end, metadata_io.read_recorded_metadata(file).gauges, metadata.gauges)
    return Run(
        path=Path(file.filename),
        identifier=metadata_io.read_identifier(file),
        metadata=metadata,
        end=end,
        time_s=read_column(file[schema.TIME], rows),
        table_reading=readings[0],
        relative_reading=readings[1] if len(readings) > 1 else None,
        status=read_column(file[schema.STATUS], rows),
        analyses=read_analyses(file),
        changes=changes,
    )


def _is_recalibrated(file: h5py.File, changes: Sequence[Change]) -> bool:
    """Tell whether readings follow a calibration that was given later."""
    return bool(count_paths(file)) and any("gauges" in change.fields for change in changes)


def _recalibrate_end(end: EndMetadata, recorded: Gauges, edited: Gauges) -> EndMetadata:
    """Rest positions of table and plate by the calibration of the last edit."""

    def convert(value_m: float | None, gauge: str) -> float | None:
        if value_m is None:
            return None
        counts = getattr(recorded, gauge).counts(np.array([value_m]))
        return float(getattr(edited, gauge).displacement_m(counts)[0])

    return end.replace(
        zero_m=convert(end.zero_m, "table"),
        relative_zero_m=convert(end.relative_zero_m, "relative"),
        held_m=convert(end.held_m, "table"),
    )
