"""The run file declared once: groups, columns and metadata fields of HDF5 with type, unit and meaning.

Paths are relative to the root of the file, except those of `GAUGE_FIELDS`, `CHECK_FIELDS` and
`ANALYSIS_FIELDS`. The attribute of a field is its dotted path in `RunMetadata`, `EndMetadata`, `Gauge`,
`GaugeCheck` or `SavedAnalysis`; a field without one is written by the program itself.
"""

import enum
from dataclasses import dataclass
from typing import Any, Final

SCHEMA: Final = 1
SUFFIX: Final = ".h5"
FIRST_VERSION: Final = "0.1.0"

ENTRY: Final = "entry"
RUN: Final = "entry/run"
NOTE: Final = "entry/run/notes/note_001"
HISTORY: Final = "entry/run/history"
OTHER_CONDITIONS: Final = "entry/run/conditions"
CHECKSUMS: Final = "entry/run/crc32"
USER: Final = "entry/user"
SAMPLE: Final = "entry/sample"
MOTION: Final = "entry/motion"
GAUGES: Final = ("entry/instrument/gauge_table", "entry/instrument/gauge_plate")
LAST_CHECK: Final = "last_check"
STAND: Final = "entry/stand"
ACQUISITION: Final = "entry/acquisition"
LOSSES: Final = "entry/acquisition/losses"
WIRE: Final = "entry/wire"
EVENTS: Final = "entry/events"
TRUTH: Final = "entry/truth"
ANALYSIS_PREFIX: Final = "analysis_"

CHUNK: Final = 8192  # rows a chunk: 64 KiB of float64, with which an hour at 2 kHz is read fastest

GROUPS: Final = {
    ENTRY: "NXentry",
    RUN: "NXcollection",
    f"{RUN}/notes": "NXcollection",
    HISTORY: "NXcollection",
    USER: "NXuser",
    SAMPLE: "NXsample",
    MOTION: "NXdata",
    "entry/instrument": "NXinstrument",
    GAUGES[0]: "NXdetector",
    GAUGES[1]: "NXdetector",
    STAND: "NXcollection",
    ACQUISITION: "NXcollection",
    LOSSES: "NXcollection",
    WIRE: "NXcollection",
    EVENTS: "NXcollection",
    CHECKSUMS: "NXcollection",
}
"""NeXus classes of the groups that every run has. They are made before the first sample: a `kill -9` inside a
flush can lose groups that are made later. A run of one gauge lacks the group of gauge 2."""


class Kind(enum.Enum):
    """How a field is stored."""

    TEXT = "text"
    NUMBER = "float64"
    INTEGER = "int64"
    VECTOR = "float64 (n,)"
    DATE = "text, ISO 8601"
    JSON = "text, JSON"
    PASS_FAIL = "text, passed or failed"


@dataclass(frozen=True, slots=True)
class Field:
    """One metadata field."""

    path: str
    description: str
    attribute: str = ""
    """Dotted path of the value in memory; "" where the program writes the field by itself."""
    kind: Kind = Kind.NUMBER
    unit: str = ""
    """Attribute `units`; `{unit}` stands for the unit of the readings."""
    default: Any = None  # value of a field that the file does not hold or that is NaN
    required: bool = False  # a file without the field is damaged
    reserved_bytes: int = 0  # room that the template makes for a text which is known at the end only
    since: str = FIRST_VERSION  # version of the program that wrote the field first


@dataclass(frozen=True, slots=True)
class Column:
    """One dataset that grows with the run."""

    path: str
    description: str
    dtype: str
    attributes: dict[str, str]
    fill: float = 0.0
    """Value of rows that are not written."""
    chunk: int = 0  # rows a chunk; 0 is `CHUNK`
    compressed: bool = False
    """For datasets written when the run is closed: a `kill -9` can make a growing one unreadable."""


def _text(path: str, description: str, attribute: str = "", **more: Any) -> Field:
    return Field(path, description, attribute, Kind.TEXT, **{"default": "", **more})


TIME: Final = f"{MOTION}/time"
STATUS: Final = f"{MOTION}/status"
STORED: Final = f"{RUN}/samples_stored"
ENDED: Final = f"{RUN}/ended"
END_TIME: Final = f"{ENTRY}/end_time"
IDENTIFIER: Final = f"{ENTRY}/entry_identifier_uuid"
PROGRAM: Final = f"{ENTRY}/program_name"
CONTACT: Final = f"{STAND}/contact"
DEVIATION: Final = "deviation"
CLOCK_SCALE: Final = f"{ACQUISITION}/clock_scale"
CLOCK_SCALE_UNCERTAINTY: Final = f"{ACQUISITION}/clock_scale_standard_uncertainty"
RELEASE: Final = f"{EVENTS}/release_s"

TIME_COLUMN: Final = Column(
    TIME,
    "device's or nominal clock, 0 at the first stored sample",
    "float64",
    {"units": "s", "long_name": "time since the first stored sample (s)"},
    fill=float("nan"),
)
STATUS_COLUMN: Final = Column(
    STATUS,
    "flags of `drivers.samples.SampleStatus`",
    "uint8",
    {
        "long_name": "flags: 1 missing, 2 damaged, 4 overload of the table gauge, 8 of the other,"
        " 16 only the table gauge missing, 32 only the other"
    },
    fill=1,  # SampleStatus.MISSING
)
WIRE_DATA: Final = Column(
    f"{WIRE}/data",
    "bytes as they came, all chunks joined",
    "uint8",
    {"long_name": "bytes as they came, chunks joined"},
    chunk=1 << 18,
    compressed=True,
)
WIRE_ARRIVAL: Final = Column(
    f"{WIRE}/arrival_time",
    "monotonic time of the host after each read",
    "int64",
    {"units": "ns", "long_name": "monotonic time of the host after the read (ns)"},
    chunk=4096,
    compressed=True,
)
WIRE_END: Final = Column(
    f"{WIRE}/chunk_end",
    "index into `data` behind the last byte of each chunk",
    "uint64",
    {"long_name": "index into data behind the last byte of each chunk"},
    chunk=4096,
    compressed=True,
)
WIRE_COLUMNS: Final = (WIRE_DATA, WIRE_ARRIVAL, WIRE_END)

ZERO_OF_CALIBRATION: Final = "that of the calibration; no tare is subtracted"
ZERO_OF_SOURCE: Final = "that of the source; no tare is subtracted"
"""Attribute `zero` of the readings. A run with counts was calibrated by this program."""

RUN_FIELDS: Final = (
    _text(f"{ENTRY}/title", "title", "title"),
    Field(f"{ENTRY}/start_time", "time of the first stored sample, if known", "start_time", Kind.DATE),
    _text(f"{USER}/name", "operator", "operator"),
    _text(f"{RUN}/series", "series code", "series", default=None),
    _text(f"{RUN}/source", "origin of a run that was not recorded by this program", "source"),
    _text(f"{RUN}/source_type", "real, simulated or imported", "stated_source", default=None),
    _text(f"{RUN}/source_file", "name of the file that a run was imported from", "source_file.name"),
    _text(f"{RUN}/source_sha256", "SHA-256 of that file", "source_file.sha256"),
    Field(f"{RUN}/source_size", "size of that file", "source_file.size_bytes", Kind.INTEGER, unit="byte"),
    _text(f"{RUN}/excluded", "reason why the run does not count in a campaign", "excluded"),
    _text(f"{NOTE}/description", "note", "note"),
    Field(f"{SAMPLE}/temperature", "temperature", "conditions.temperature_c", unit="degC"),
    Field(f"{SAMPLE}/humidity", "relative humidity", "conditions.humidity_percent", unit="%"),
    _text(f"{RUN}/plate_id", "plate", "conditions.plate_id"),
    _text(f"{RUN}/contact_id", "contact", "conditions.contact_id"),
    _text(f"{RUN}/surface_preparation", "surface preparation", "conditions.surface_preparation"),
    Field(f"{RUN}/run_in_number", "run-in number", "conditions.run_in_number", Kind.INTEGER),
    Field(
        f"{STAND}/configuration", "the stand's settings at the time of the run", "stand", Kind.JSON,
        required=True,
    ),
    _text(f"{STAND}/name", "name of the stand", "stand.name"),
    Field(f"{STAND}/table_mass", "mass of the table", "table_mass_kg", unit="kg", required=True),
    Field(
        f"{STAND}/plate_mass", "mass of the plate with its added mass", "plate_mass_kg", unit="kg",
        required=True,
    ),
    Field(f"{STAND}/pullback", "nominal pullback", "pullback_m", unit="m"),
    Field(
        f"{STAND}/table_mass_standard_uncertainty", "standard uncertainty of the table's mass",
        "stand.table_mass_standard_uncertainty_kg", unit="kg", required=True,
    ),
    Field(
        f"{STAND}/plate_mass_standard_uncertainty", "standard uncertainty of the plate's mass",
        "stand.plate_mass_standard_uncertainty_kg", unit="kg", required=True,
    ),
    Field(f"{STAND}/gravity", "gravity", "stand.gravity_m_per_s2", unit="m/s^2", required=True),
    Field(
        f"{STAND}/gravity_standard_uncertainty", "standard uncertainty of gravity",
        "stand.gravity_standard_uncertainty_m_per_s2", unit="m/s^2", required=True,
    ),
    _text(f"{ACQUISITION}/protocol", "protocol of the device", "device.protocol"),
    _text(f"{ACQUISITION}/device", "name of the device", "device.name"),
    _text(f"{ACQUISITION}/firmware", "firmware of the device", "device.firmware"),
    _text(f"{ACQUISITION}/serial_number", "serial number of the device", "device.serial_number"),
    Field(
        f"{ACQUISITION}/device_settings", "settings that the device reported", "device.settings", Kind.JSON,
        default={},
    ),
    Field(
        f"{ACQUISITION}/configuration", "settings of the device in the calibration file", "gauges.device",
        Kind.JSON, default={},
    ),
    _text(f"{ACQUISITION}/port", "address of the port and its USB identity", "port"),
    _text(f"{ACQUISITION}/host", "name of the computer", "host"),
    Field(f"{ACQUISITION}/rate_nominal", "nominal sampling rate", "rate_hz", unit="Hz"),
)  # fmt: skip
"""Fields of `app.runs.metadata.RunMetadata`. An empty text and an unknown number are left out."""

GAUGE_FIELDS: Final = (
    _text("serial_number", "serial number of the gauge", "serial_number"),
    Field("calibration_date", "day of the calibration", "date", Kind.DATE),
    Field("calibration/gain", "gain", "gain_m_per_count", unit="{unit}/count", required=True),
    Field("calibration/zero", "count at zero displacement", "zero_count", unit="count", required=True),
    Field(
        "calibration/gain_relative_standard_uncertainty", "relative standard uncertainty of the gain",
        "gain_relative_standard_uncertainty", unit="1",
    ),
    Field(
        "calibration/zero_standard_uncertainty", "standard uncertainty of the zero",
        "zero_standard_uncertainty_m", unit="{unit}",
    ),
    Field(
        "calibration/nonlinearity", "largest deviation from line or polynomial", "nonlinearity_m",
        unit="{unit}",
    ),
    Field("calibration/hysteresis", "hysteresis", "hysteresis_m", unit="{unit}"),
    Field("calibration/repeatability", "repeatability", "repeatability_m", unit="{unit}"),
    Field("calibration/delay", "delay of the reading", "delay_s", unit="s", required=True),
    Field(
        "calibration/delay_standard_uncertainty", "standard uncertainty of the delay",
        "delay_standard_uncertainty_s", unit="s", required=True,
    ),
    Field("calibration/range", "largest displacement of the gauge", "range_m", unit="{unit}"),
    Field("calibration/polynomial", "p1, p2 in x + p1 x^2 + p2 x^3", "polynomial", Kind.VECTOR, default=()),
    _text("calibration/reference", "reference of the calibration", "reference"),
    _text("calibration/certificate", "certificate of the reference", "certificate"),
    _text("calibration/calibrated_by", "who calibrated the gauge", "calibrated_by"),
    Field("calibration/valid_until", "last day on which the calibration holds", "valid_until", Kind.DATE),
    Field(
        "calibration/filter", "low-pass filter before the counts: kind, order, corner_hz (-3 dB)", "filter",
        Kind.JSON,
    ),
    _text("calibration/measures", "what gauge 2 measures: relative or plate", "measures", required=True),
)  # fmt: skip
"""Fields of `config.schema.Gauge`, in the group of each gauge."""

CHECK_FIELDS: Final = (
    Field("date", "time of the check", "at", Kind.DATE, required=True),
    Field("result", "whether the gauge passed", "passed", Kind.PASS_FAIL, required=True),
    Field("expected", "displacement that was applied", "expected_m", unit="m", required=True),
    Field("measured", "displacement that was measured", "measured_m", unit="m", required=True),
    Field(DEVIATION, "measured minus expected", unit="m"),
    Field("tolerance", "largest deviation that passes", "tolerance_m", unit="m", required=True),
    Field(
        "gain", "gain of the calibration that was checked", "gain_m_per_count", unit="m/count",
        required=True,
    ),
    Field("polynomial", "polynomial of that calibration", "polynomial", Kind.VECTOR, default=()),
    _text("kind", "displacement or shunt", "kind", required=True),
    _text("reference", "reference of the check", "reference"),
    _text("checked_by", "who checked the gauge", "checked_by"),
    _text("device", "device that the gauge was read by", "device"),
    _text("serial_number", "serial number of the gauge", "serial_number"),
)  # fmt: skip
"""Fields of `config.schema.GaugeCheck`, in the group `last_check` of each gauge that was checked."""

END_FIELDS: Final = (
    Field(f"{EVENTS}/pulled_back_s", "the pullback was reached", "events.pulled_back_s", unit="s"),
    Field(f"{EVENTS}/armed_s", "the trigger was armed", "events.armed_s", unit="s"),
    Field(RELEASE, "the table was released", "events.release_s", unit="s"),
    Field(f"{EVENTS}/slip_end_s", "the plate stopped slipping", "events.slip_end_s", unit="s"),
    Field(f"{EVENTS}/rest_s", "the table came to rest", "events.rest_s", unit="s"),
    *(
        Field(f"{LOSSES}/{name}", description, f"losses.{name}", Kind.INTEGER, default=0)
        for name, description in (
            ("samples", "rows, absent samples included"),
            ("missing", "samples lost by the device's sequence numbers"),
            ("missing_estimated", "samples lost by elapsed time and rate"),
            ("damaged", "samples received damaged"),
            ("overloaded", "samples beyond the range of the converter"),
            ("discarded_bytes", "bytes that belong to no good frame or line"),
            ("restarts", "restarts of the device within the stream"),
            ("repeated", "frames or lines received twice and stored once"),
            ("unexplained_drops", "drops that the device reported without a gap in its sequence"),
        )
    ),
    Field(CLOCK_SCALE, "true seconds for one second of `time`", "time_base.scale", unit="1", default=1.0),
    Field(
        CLOCK_SCALE_UNCERTAINTY, "standard uncertainty of the clock scale",
        "time_base.scale_standard_uncertainty", unit="1", default=0.0,
    ),
    Field(
        f"{ACQUISITION}/skew", "time from the reading of gauge 1 to that of gauge 2", "time_base.skew_s",
        unit="s",
    ),
    Field(
        f"{ACQUISITION}/skew_standard_uncertainty", "standard uncertainty of the skew",
        "time_base.skew_standard_uncertainty_s", unit="s",
    ),
    Field(f"{RUN}/dwell_before_release", "hold at the pullback", "dwell_s", unit="s"),
    Field(f"{RUN}/zero_before_pull", "table at rest before the pull", "zero_m", unit="m"),
    Field(f"{RUN}/relative_zero_before_pull", "plate at rest before the pull", "relative_zero_m", unit="m"),
    Field(f"{RUN}/held_displacement", "table in the hold", "held_m", unit="m"),
    _text(f"{RUN}/message", "fault that ended the run", "message", reserved_bytes=2000),
    Field(END_TIME, "time of the end", "end_time", Kind.DATE, reserved_bytes=40),
    _text(ENDED, "reason of the end; empty while the run is not closed", "ended", reserved_bytes=32),
)  # fmt: skip
"""Fields of `app.runs.metadata.EndMetadata`. The template makes room for them; closing a run fills it."""

PROGRAM_FIELDS: Final = (
    _text(IDENTIFIER, "UUID of the run"),
    _text(PROGRAM, "slipstand; its version is the attribute `version`"),
    _text(CONTACT, "contact by the series code"),
    Field(STORED, "rows that are whole on disk, written after each flush", kind=Kind.INTEGER, required=True),
    _text(f"{NOTE}/author", "operator"),
    Field(f"{NOTE}/date", "start of the run", kind=Kind.DATE),
    _text(f"{NOTE}/type", "media type of the note"),
)
"""Fields that the program writes by itself."""

ANALYSIS_CHECKSUM: Final = "crc32"
ANALYSIS_FIELDS: Final = (
    _text("program", "slipstand"),
    _text("version", "its version", "version"),
    _text("commit", "commit that it was made of, where known", "commit"),
    Field("date", "time of the analysis", "date", Kind.DATE),
    Field("sequence_index", "number of the analysis", "number", Kind.INTEGER),
    Field("settings", "how it was analysed", "settings", Kind.JSON, default={}),
    _text("request_hash", "hash of what the settings ask for", "request_hash"),
    _text("inputs_hash", "hash of readings, masses, calibration and clock", "inputs_hash"),
    _text("facts_hash", "hash of the same without the readings", "metadata_hash"),
    _text("reproduce", "command that gives the same digits", "reproduce"),
    Field("document", "the result, as `analyze --json` gives it", "document", Kind.JSON),
    Field(ANALYSIS_CHECKSUM, "CRC-32 of the texts above, sorted by name", kind=Kind.INTEGER),
)
"""Fields of `app.runs.saved_analyses.SavedAnalysis`, in the group `analysis_NNN` of each saved analysis."""

REQUIRED_FIELDS: Final = tuple(
    field for field in (*RUN_FIELDS, *END_FIELDS, *PROGRAM_FIELDS) if field.required
)
"""Fields without which a file is damaged, those of gauges aside."""


def signal_path(gauge: int, quantity: str, measures: str) -> str:
    """Path of the calibrated readings of gauge 0 or 1, such as `entry/motion/table_displacement`."""
    return f"{MOTION}/{'table' if gauge == 0 else measures}_{quantity}"


def count_path(gauge: int) -> str:
    """Path of the readings of gauge 0 or 1 as received."""
    return f"{GAUGES[gauge]}/data"


def checksum_path(column: str) -> str:
    """Path of the CRC-32 of a column, by the path of the column."""
    return f"{CHECKSUMS}/{'_'.join(column.split('/')[2:])}"
