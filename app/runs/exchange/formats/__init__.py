"""Formats of foreign files: each module opens one kind as an `app.runs.exchange.tables.Table`."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Format:
    """A format that is no plain text."""

    name: str
    suffixes: tuple[str, ...]
    module: str
    """Module below `app.runs.exchange.formats`; its `open_table(path, layout, report)` opens the file."""
    magic: bytes = b""
    """First bytes of such a file, where they tell it."""
    readers: tuple[str, ...] = ()
    """Libraries that read it, which may take long to load; pyarrow imports pandas when it gives arrays."""
    has_rows: bool = False
    """Whether it has lines and a header, as a sheet has."""
    has_own_time: bool = False
    """Whether it always keeps times or a rate beside the columns."""

    @property
    def module_name(self) -> str:
        return f"{__name__}.{self.module}"


FORMATS = (
    Format("MATLAB", (".mat",), "matlab", b"MATLAB ", ("scipy.io",)),
    Format("Excel", (".xlsx",), "excel", readers=("openpyxl",), has_rows=True),
    Format("Parquet", (".parquet",), "parquet", b"PAR1", ("pyarrow.parquet", "pandas")),
    Format("TDMS", (".tdms",), "tdms", b"TDSm", ("nptdms",)),
    Format("LVM", (".lvm",), "labview", b"LabVIEW Measurement", ("lvm_read",), has_own_time=True),
    Format("UFF 58", (".uff", ".unv", ".uff58"), "universal", b"    -1", ("pyuff",), has_own_time=True),
    Format("MDF", (".mf4", ".mdf"), "mdf", b"MDF ", ("asammdf",), has_own_time=True),
    Format("WAV", (".wav",), "wave", b"RIFF", ("scipy.io",), has_own_time=True),
    Format("catman", (".bin",), "catman"),
    Format("HDF5", (".h5", ".hdf5", ".hdf"), "hdf5", b"\x89HDF"),
)
SUFFIXES = (
    ".csv", ".txt", ".tsv", ".dat", ".asc", ".gz", *(suffix for one in FORMATS for suffix in one.suffixes)
)  # fmt: skip
"""Names of files that can be imported; a text may have any other."""
