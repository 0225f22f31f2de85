"""Opens run files: one frozen value with everything that an analysis or a plot needs."""

import contextlib
import datetime
import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import h5py
import msgspec
import numpy as np
from numpy.typing import NDArray

from app.runs import schema as names
from app.runs.blocks import count_flags
from app.runs.checksums import read_column
from app.runs.errors import BeingRecordedError, DamagedRunError, NotARunError, RunError, RunNotFoundError
from app.runs.lock import is_being_recorded
from app.runs.metadata import EndMetadata, Events, RunMetadata
from app.runs.metadata_io import Change, read_changes, read_metadata, read_recorded_metadata
from app.runs.raw_bytes import RawBytes, read_raw_bytes
from app.runs.saved_analyses import SavedAnalysis, read_analyses
from app.runs.schema import read_text
from app.runs.validation import count_paths, is_finished, signal_paths, stored_rows
from app.runs.validator import Validator
from config.schema import Gauge, Gauges
from drivers.samples import ABSENT_BY_GAUGE, Losses

T = TypeVar("T")
_HDF5 = b"\x89HDF\r\n\x1a\n"


@dataclass(frozen=True, eq=False, slots=True)
class Run:
    """A run as stored, with all edits applied.

    Attributes
    ----------
    path : Path
    identifier : str
        UUID given when it was recorded.
    metadata : RunMetadata
        With the latest value of everything that was edited.
    ending : Ending or None
        None for a run that was never closed: its writer died.
    time_s : (n,) float64
        Since the first stored sample, on the device's or nominal clock.
    table_reading : (n,) float64
        Gauge 1, in `metadata.unit`; NaN where absent.
    relative_reading : (n,) float64 or None
        Gauge 2, plate against table or against base as its calibration says; None without one.
    status : (n,) uint8
        `drivers.samples.SampleStatus` flags.
    analyses : tuple of SavedAnalysis
        Oldest first.
    changes : tuple of Change
        Edits, oldest first.
    """

    path: Path
    identifier: str
    metadata: RunMetadata
    end: EndMetadata | None
    time_s: NDArray[np.float64]
    table_reading: NDArray[np.float64]
    relative_reading: NDArray[np.float64] | None
    status: NDArray[np.uint8]
    analyses: tuple[SavedAnalysis, ...]
    changes: tuple[Change, ...]

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def losses(self) -> Losses:
        """Account of the rows; of an unfinished run, what their flags tell."""
        return self.end.losses if self.end else count_flags(self.status)

    @property
    def events(self) -> Events:
        """What happened when, as far as the file knows."""
        return self.end.events if self.end else Events()


def open_run(path: Path | str, *, validator: Validator | None = None, trusted: bool = False) -> Run:
    """Read a run.

    Parameters
    ----------
    path
        Of the run file.
    validator
        Looks the file over first, in a process of its own; one is started when none is given. Share
        one to open many runs.
    trusted
        The caller wrote the file itself and has checked it: read it without examination.

    Raises
    ------
    RunNotFoundError, NotARunError, BeingRecordedError, DamagedRunError
    """
    return validate_and_read(path, _read, validator=validator, trusted=trusted)


def calibrate(counts: NDArray[Any], gauge: Gauge) -> NDArray[np.float64]:
    """Readings from counts."""
    return gauge.displacement_m(counts.astype(np.float64))


def load_counts(run: Run) -> NDArray[np.int32] | NDArray[np.float64] | None:
    """Readings as received, (n, channels); None where there are none. Raises RunError."""
    return read_file(run.path, lambda file: _counts(file, len(run)))


def load_raw_bytes(run: Run) -> RawBytes:
    """The bytes as they came. Raises RunError."""
    return read_file(run.path, read_raw_bytes)


def validate_and_read(
    path: Path | str, read: Callable[[h5py.File], T], *, validator: Validator | None, trusted: bool = False
) -> T:
    """Have a file examined, unless it is trusted, and read something of it. Raises like `open_run`."""
    path = Path(path).absolute()
    check_openable(path)
    if not trusted:
        with contextlib.nullcontext(validator) if validator else Validator.start() as its:
            its.validate(path)
    return read_file(path, read)


def check_openable(path: Path) -> None:
    """Refuse, without HDF5, what can be seen to be no closed or abandoned run.

    Raises
    ------
    RunNotFoundError, BeingRecordedError, NotARunError
    """
    try:
        if path.is_dir():
            raise NotARunError(f"{path} is a folder. Give a run file in it")
        with path.open("rb") as file:
            signature = file.read(len(_HDF5))
    except FileNotFoundError:
        raise RunNotFoundError(f"{path}: there is no such file. Give the path of a run") from None
    except OSError as error:
        raise RunNotFoundError(f"{path}: cannot be read ({error.strerror}). Check its rights") from None
    if is_being_recorded(path):
        raise BeingRecordedError(f"{path} is being recorded. Wait until the run has ended")
    if signature != _HDF5:
        raise NotARunError(
            f"{path} is not an HDF5 file. Give a run file, or bring it in with `slipstand import`"
        )


def read_file(path: Path, read: Callable[[h5py.File], T]) -> T:
    """Open a file that was examined, read, close; whatever HDF5 stumbles over is damage. Raises RunError."""
    try:
        with h5py.File(path, "r", locking="best-effort") as file:
            return read(file)
    except BlockingIOError:
        raise BeingRecordedError(f"{path} is being recorded. Wait until the run has ended") from None
    except RunError:
        raise
    except (OSError, RuntimeError, ValueError, KeyError, TypeError, AttributeError, ArithmeticError) as error:
        fault = str(error).replace("\n", " ")[:160]
        raise DamagedRunError(f"{path} is damaged ({fault}). Restore a good copy, or recover it") from None


def _read(file: h5py.File) -> Run:
    rows = stored_rows(file)
    metadata = read_metadata(file)
    changes = tuple(read_changes(file))
    readings = reading_columns(file, metadata, changes)(slice(rows))
    ending = read_end_metadata(file)
    if ending is not None and _is_recalibrated(file, changes):
        ending = _recalibrated(ending, read_recorded_metadata(file).gauges, metadata.gauges)
    return Run(
        path=Path(file.filename),
        identifier=names.read_text(file, f"{names.ENTRY}/entry_identifier_uuid"),
        metadata=metadata,
        end=ending,
        time_s=read_column(file[names.TIME], slice(rows)),
        table_reading=readings[0],
        relative_reading=readings[1] if len(readings) > 1 else None,
        status=read_column(file[names.STATUS], slice(rows)),
        analyses=read_analyses(file),
        changes=changes,
    )


def reading_columns(
    file: h5py.File, metadata: RunMetadata, changes: Sequence[Change]
) -> Callable[[slice], list[NDArray[np.float64]]]:
    """What reads some rows of each gauge: as stored, or by a calibration that was given later.

    Where they are all rows, they are checked (`app.runs.checksums`).
    """
    counts = [file[path] for path in count_paths(file)]
    if not _is_recalibrated(file, changes):
        signals = [file[path] for path in signal_paths(file)]
        return lambda rows: [read_column(column, rows) for column in signals]
    status, gauges = file[names.STATUS], (metadata.gauges.table, metadata.gauges.relative)

    def recalibrated(rows: slice) -> list[NDArray[np.float64]]:
        flags = read_column(status, rows)
        columns = zip(counts, gauges, ABSENT_BY_GAUGE, strict=False)
        return [
            np.where((flags & absent) != 0, np.nan, calibrate(read_column(column, rows), gauge))
            for column, gauge, absent in columns
        ]

    return recalibrated


def _is_recalibrated(file: h5py.File, changes: Sequence[Change]) -> bool:
    """Tell whether readings follow a calibration that was given later."""
    return bool(count_paths(file)) and any("gauges" in change.fields for change in changes)


def _recalibrated(ending: EndMetadata, stored: Gauges, now: Gauges) -> EndMetadata:
    """Where table and plate rested, read by the calibration of now."""

    def again(value_m: float | None, gauge: str) -> float | None:
        if value_m is None:
            return None
        counts = getattr(stored, gauge).counts(np.array([value_m]))
        return float(getattr(now, gauge).displacement_m(counts)[0])

    return ending.replace(
        zero_m=again(ending.zero_m, "table"),
        relative_zero_m=again(ending.relative_zero_m, "relative"),
        held_m=again(ending.held_m, "table"),
    )


def read_end_metadata(file: h5py.File) -> EndMetadata | None:
    """What was known when the run ended; None where it was never closed."""
    if not is_finished(file):
        return None
    events = {name: names.read_number(file, names.event_path(name)) for name in Events.__struct_fields__}
    losses = {name: names.read_integer(file, f"{names.LOSSES}/{name}") for name in Losses.__slots__}
    scale = names.read_number(file, names.CLOCK_SCALE)
    return EndMetadata(
        ended=names.read_text(file, names.ENDED),
        end_time=datetime.datetime.fromisoformat(names.read_text(file, names.END_TIME)),
        events=Events(**events),
        losses=Losses(**losses),
        clock_scale=1.0 if scale is None else scale,
        clock_scale_uncertainty=names.read_number(file, names.CLOCK_SCALE_UNCERTAINTY) or 0.0,
        skew_s=names.read_number(file, names.SKEW),
        skew_standard_uncertainty_s=names.read_number(file, names.SKEW_UNCERTAINTY),
        dwell_s=names.read_number(file, names.DWELL),
        zero_m=names.read_number(file, names.ZERO),
        relative_zero_m=names.read_number(file, names.RELATIVE_ZERO),
        held_m=names.read_number(file, names.HELD),
        message=names.read_text(file, names.MESSAGE),
    )


def _counts(file: h5py.File, rows: int) -> NDArray[np.int32] | NDArray[np.float64] | None:
    columns = [read_column(file[path], slice(rows)) for path in count_paths(file)]
    return np.column_stack(columns) if columns else None


class Fingerprint(msgspec.Struct, frozen=True):
    """Of one run file.

    Attributes
    ----------
    name : str
        Of the file, without its folder.
    size_bytes : int
    sha256 : str
        Of the whole file; it changes when an analysis or an edit is added to the run.
    identifier : str
        UUID given when it was recorded, which never changes.
    columns : dict of str
        CRC-32 of each column of samples, hexadecimal, as kept when the run was closed: these never change
        either.
    """

    name: str
    size_bytes: int
    sha256: str
    identifier: str = ""
    columns: dict[str, str] = {}


def compute_fingerprint(path: Path) -> Fingerprint:
    """Take the fingerprint of a run file that was examined. Raises RunError."""
    hashed, size = file_sha256(path)
    identifier, columns = read_file(path, _kept)
    return Fingerprint(path.name, size, hashed, identifier, columns)


def file_sha256(path: Path) -> tuple[str, int]:
    """SHA-256 of a file, hexadecimal, and its size in bytes. Raises RunNotFoundError."""
    try:
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256")
            return digest.hexdigest(), file.tell()
    except OSError as error:
        raise RunNotFoundError(f"{path}: cannot be read ({error.strerror}). Check its rights") from None


def _kept(file: h5py.File) -> tuple[str, dict[str, str]]:
    group = file.get(names.CHECKSUMS)
    columns = (
        {} if group is None else {name: f"{int(np.uint32(value[()])):08x}" for name, value in group.items()}
    )
    return read_text(file, f"{names.ENTRY}/entry_identifier_uuid"), columns
