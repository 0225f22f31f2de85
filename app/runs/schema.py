"""Names, types and small habits of the run file, in one place (people's version: recordings/README.md)."""

from typing import Any, Final

import h5py
import numpy as np

from app.runs.errors import DamagedRunError, MetadataError

SCHEMA: Final = 1
SUFFIX: Final = ".h5"

ENTRY: Final = "entry"
RUN: Final = "entry/run"
NOTES: Final = "entry/run/notes"
HISTORY: Final = "entry/run/history"
USER: Final = "entry/user"
SAMPLE: Final = "entry/sample"
MOTION: Final = "entry/motion"
INSTRUMENT: Final = "entry/instrument"
GAUGES: Final = ("entry/instrument/gauge_table", "entry/instrument/gauge_plate")
STAND: Final = "entry/stand"
ACQUISITION: Final = "entry/acquisition"
LOSSES: Final = "entry/acquisition/losses"
WIRE: Final = "entry/wire"
CHECKSUMS: Final = "entry/run/crc32"
EVENTS: Final = "entry/events"
TRUTH: Final = "entry/truth"
ANALYSIS_PREFIX: Final = "analysis_"

GROUPS: Final = {
    ENTRY: "NXentry",
    RUN: "NXcollection",
    NOTES: "NXcollection",
    HISTORY: "NXcollection",
    USER: "NXuser",
    SAMPLE: "NXsample",
    MOTION: "NXdata",
    INSTRUMENT: "NXinstrument",
    GAUGES[0]: "NXdetector",
    GAUGES[1]: "NXdetector",
    STAND: "NXcollection",
    ACQUISITION: "NXcollection",
    LOSSES: "NXcollection",
    WIRE: "NXcollection",
    EVENTS: "NXcollection",
    CHECKSUMS: "NXcollection",
}
"""Groups of every run, made before the first sample: late ones can be lost to a `kill -9` in a flush."""

TIME: Final = f"{MOTION}/time"
STATUS: Final = f"{MOTION}/status"
STORED: Final = f"{RUN}/samples_stored"
"""Rows known to be whole on disk; written after the flush that put them there, so never too large."""
ENDED: Final = f"{RUN}/ended"
END_TIME: Final = f"{ENTRY}/end_time"
WIRE_DATA: Final = f"{WIRE}/data"
WIRE_ARRIVAL: Final = f"{WIRE}/arrival_time"
WIRE_END: Final = f"{WIRE}/chunk_end"

CHUNK: Final = 8192
"""Samples a chunk: 64 KiB of float64, which an hour at 2 kHz reads fastest with."""

MESSAGE: Final = f"{RUN}/message"
DWELL: Final = f"{RUN}/dwell_before_release"
ZERO: Final = f"{RUN}/zero_before_pull"
RELATIVE_ZERO: Final = f"{RUN}/relative_zero_before_pull"
ZERO_OF_CALIBRATION: Final = "that of the calibration; no tare is subtracted"
ZERO_OF_SOURCE: Final = "that of the source; no tare is subtracted"
"""What the attribute `zero` of the readings says: a run with counts was calibrated here."""
HELD: Final = f"{RUN}/held_displacement"
CLOCK_SCALE: Final = f"{ACQUISITION}/clock_scale"
CLOCK_SCALE_UNCERTAINTY: Final = f"{ACQUISITION}/clock_scale_standard_uncertainty"
SKEW: Final = f"{ACQUISITION}/skew"
SKEW_UNCERTAINTY: Final = f"{ACQUISITION}/skew_standard_uncertainty"

TEXT_ROOM: Final = {END_TIME: 40, ENDED: 32, MESSAGE: 2000}
"""Bytes of each text that is only known at the end."""


def signal_name(gauge: int, quantity: str, measures: str) -> str:
    """Path of the calibrated readings of gauge 0 or 1: `table_displacement`, `relative_displacement`, ..."""
    what = "table" if gauge == 0 else measures
    return f"{MOTION}/{what}_{quantity}"


def checksum_path(column: str) -> str:
    """Path of the CRC-32 of a column's bytes, by the path of the column."""
    return f"{CHECKSUMS}/{'_'.join(column.split('/')[2:])}"


def event_path(name: str) -> str:
    """Path of an event, by its field of `app.runs.metadata.Events`."""
    return f"{EVENTS}/{name}"


def write_text(group: h5py.Group, name: str, text: str) -> None:
    """Store a text of fixed length; an empty one is left out. Raises MetadataError."""
    if not text:
        return
    data = encode_text(name, text)
    group.create_dataset(name, data=np.bytes_(data), dtype=h5py.string_dtype("utf-8", len(data)))


def write_number(group: h5py.Group, name: str, value: float | None, units: str = "") -> None:
    """Store a number with its units; None is left out."""
    if value is None:
        return
    dataset = group.create_dataset(name, data=value)
    if units:
        dataset.attrs["units"] = units


def reserve_text(file: h5py.File, path: str) -> None:
    """Make room for a text that is only known at the end, so that no object is created then."""
    file.create_dataset(path, data=np.bytes_(b""), dtype=h5py.string_dtype("utf-8", TEXT_ROOM[path]))


def fill_text(file: h5py.File, path: str, text: str) -> None:
    """Write a text into its reserved room, cut to fit."""
    data = encode_text(path, text)[: TEXT_ROOM[path]]
    file[path][()] = np.bytes_(data.decode("utf-8", "ignore").encode())


def read_text(group: h5py.Group, name: str, default: str = "") -> str:
    """Read a text, `default` where there is none. Raises DamagedRunError."""
    dataset = group.get(name)
    if dataset is None:
        return default
    value = dataset[()]
    if not isinstance(value, bytes | str):
        raise DamagedRunError(
            f"{group.file.filename}: {group.name}/{name} is not a text. Restore a good copy"
        )
    return value if isinstance(value, str) else value.decode("utf-8", "replace")


def read_number(group: h5py.Group, name: str) -> float | None:
    """Read a number; None where it is absent or NaN. Raises DamagedRunError."""
    dataset = group.get(name)
    if dataset is None:
        return None
    value = dataset[()]
    if not isinstance(value, np.number):
        raise DamagedRunError(
            f"{group.file.filename}: {group.name}/{name} is not a number. Restore a good copy"
        )
    return None if np.isnan(value) else float(value)


def read_integer(group: h5py.Group, name: str) -> int:
    """Read a whole number, 0 where there is none. Raises DamagedRunError."""
    return int(read_number(group, name) or 0)


def to_python(value: Any) -> Any:
    """Turn what h5py reads into plain Python: str, int, float, bool or list."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def encode_text(name: str, text: str) -> bytes:
    """Bytes of a text as a run file can hold it; `name` is what to call it. Raises MetadataError."""
    try:
        data = text.encode("utf-8")
    except UnicodeEncodeError:
        raise MetadataError(f"{name} = {text!r} is not valid Unicode. Write it again") from None
    if b"\0" in data:
        raise MetadataError(f"{name} = {text!r} holds a zero character. Leave it out")
    return data
