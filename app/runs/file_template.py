"""All groups and datasets of a run file, made before the first sample.

What is only known at the end gets its room here and is filled in place: objects made late can be
lost, and take others with them, when the process is killed inside a flush of HDF5.
"""

import datetime

import h5py
import numpy as np

from app.runs import schema as names
from app.runs.blocks import BlockLayout
from app.runs.checksums import reserve_checksum
from app.runs.metadata import Events, RunMetadata
from app.runs.metadata_io import make_group, write_metadata
from app.runs.schema import reserve_text
from app.version import __version__
from drivers.samples import Losses, SampleStatus


def create_template(
    file: h5py.File, name: str, metadata: RunMetadata, layout: BlockLayout, identifier: str = ""
) -> None:
    """Make everything but the rows, in a new file that will be called `name`. Raises MetadataError."""
    _root(file, name)
    for path, nx_class in names.GROUPS.items():
        if path != names.GAUGES[1] or layout.channels == 2:
            make_group(file, path, nx_class)
    file.attrs["default"] = "entry"
    file[names.ENTRY].attrs["default"] = "motion"
    write_metadata(file, metadata, identifier)
    _motion(file, metadata, layout)
    if layout.counts:
        for gauge in range(layout.channels):
            data = _column(file, f"{names.GAUGES[gauge]}/data", layout.counts, 0)
            data.attrs.update({"units": "count", "long_name": "readings as received"})
    _wire(file)
    _rooms(file)
    for path in column_paths(metadata, layout):
        reserve_checksum(file, path)


def column_paths(metadata: RunMetadata, layout: BlockLayout) -> list[str]:
    """Datasets that grow while recording: time, readings of each gauge, status, counts of each gauge."""
    gauges = range(layout.channels)
    counts = [f"{names.GAUGES[i]}/data" for i in gauges] if layout.counts else []
    return [names.TIME, *(_signal(metadata, i) for i in gauges), names.STATUS, *counts]


def _signal(metadata: RunMetadata, gauge: int) -> str:
    return names.signal_name(gauge, metadata.quantity, metadata.gauges.relative.measures)


def _root(file: h5py.File, name: str) -> None:
    file.attrs.update(
        {
            "NX_class": "NXroot",
            "slipstand_schema": names.SCHEMA,
            "creator": "slipstand",
            "creator_version": __version__,
            "file_name": name,
            "file_time": datetime.datetime.now().astimezone().isoformat(timespec="seconds"),
            "HDF5_Version": h5py.version.hdf5_version,
            "h5py_version": h5py.version.version,
        }
    )


def _motion(file: h5py.File, metadata: RunMetadata, layout: BlockLayout) -> None:
    time = _column(file, names.TIME, "float64", np.nan)
    time.attrs.update({"units": "s", "long_name": "time since the first stored sample"})
    time.attrs["start"] = metadata.start_time.isoformat()
    time.make_scale("time")
    signals = [_signal(metadata, gauge) for gauge in range(layout.channels)]
    for path in signals:
        reading = _column(file, path, "float64", np.nan)
        reading.attrs.update({"units": metadata.unit, "quantity": metadata.quantity})
        reading.attrs["long_name"] = path.rpartition("/")[2].replace("_", " ")
        reading.attrs["zero"] = names.ZERO_OF_CALIBRATION if layout.counts else names.ZERO_OF_SOURCE
    status = _column(file, names.STATUS, "uint8", SampleStatus.MISSING)
    status.attrs["long_name"] = (
        "flags: 1 missing, 2 damaged, 4 overload of the table gauge, 8 of the other,"
        " 16 only the table gauge missing, 32 only the other"
    )
    for path in [*signals, names.STATUS]:
        file[path].dims[0].attach_scale(time)
    leaves = [path.rpartition("/")[2] for path in signals]
    motion = file[names.MOTION]
    motion.attrs.update({"signal": leaves[0], "axes": ["time"], "time_indices": [0]})
    if leaves[1:]:
        motion.attrs["auxiliary_signals"] = leaves[1:]


def _column(file: h5py.File, path: str, dtype: str, fill: float) -> h5py.Dataset:
    return file.create_dataset(
        path, shape=(0,), maxshape=(None,), chunks=(names.CHUNK,), dtype=dtype, fillvalue=fill
    )


def _wire(file: h5py.File) -> None:
    packed = {"shape": (0,), "maxshape": (None,), "compression": "gzip", "compression_opts": 1}
    data = file.create_dataset(names.WIRE_DATA, dtype="uint8", chunks=(1 << 18,), **packed)
    data.attrs["long_name"] = "bytes as they came, chunks joined"
    arrival = file.create_dataset(names.WIRE_ARRIVAL, dtype="int64", chunks=(4096,), shuffle=True, **packed)
    arrival.attrs.update({"units": "ns", "long_name": "monotonic time of the host after the read"})
    end = file.create_dataset(names.WIRE_END, dtype="uint64", chunks=(4096,), shuffle=True, **packed)
    end.attrs["long_name"] = "index into data behind the last byte of each chunk"


def _rooms(file: h5py.File) -> None:
    for path in names.TEXT_ROOM:
        reserve_text(file, path)
    for name in Events.__struct_fields__:
        _number(file, names.event_path(name), np.nan, "s")
    _number(file, names.DWELL, np.nan, "s")
    _number(file, names.ZERO, np.nan, "m")
    _number(file, names.RELATIVE_ZERO, np.nan, "m")
    _number(file, names.HELD, np.nan, "m")
    _number(file, names.CLOCK_SCALE, 1.0, "1")
    _number(file, names.CLOCK_SCALE_UNCERTAINTY, 0.0, "1")
    _number(file, names.SKEW, np.nan, "s")
    _number(file, names.SKEW_UNCERTAINTY, np.nan, "s")
    for name in Losses.__slots__:
        file.create_dataset(f"{names.LOSSES}/{name}", data=np.int64(0))
    file.create_dataset(names.STORED, data=np.uint64(0))


def _number(file: h5py.File, path: str, value: float, units: str) -> None:
    file.create_dataset(path, data=value).attrs["units"] = units
