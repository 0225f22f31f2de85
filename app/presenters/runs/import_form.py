"""Fields of the import dialog: one table of titles, choices, options of the command line, and rules."""

import datetime
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import PurePath

from app.presenters import number_text
from app.presenters.conditions import CONDITION_FIELDS, CONDITION_TITLES, parse_conditions
from app.runs.errors import ConditionError, MetadataError
from messages.i18n import N_, gettext, translate
from messages.message import Message, message

GAIN = "gain"  # choice of `unit` for a gain instead
Form = Mapping[str, str]  # texts as typed, or chosen values, by name of the field


@dataclass(frozen=True, slots=True)
class NumberRule:
    """Which numbers a field takes."""

    fault: str  # message about another text, with the field `{text}`
    is_valid: Callable[[float], bool] = lambda _: True
    convert: Callable[[float], float] = float


@dataclass(frozen=True, slots=True)
class Field:
    """A field: a line of text, or a choice."""

    name: str
    title: str
    hint: str = ""
    """What holds if nothing is typed."""
    option: str = ""  # option of `slipstand import`, as messages of the importer name it
    choices: Mapping[str, str] | None = None
    """Titles by value, the first as default; empty for columns of the file, None for a line of text."""
    rule: NumberRule | None = None

    def parse(self, form: Form) -> float | None:
        """Read the number of the field in a valid form; None if it is empty."""
        value = number_text.parse_number(form[self.name])
        return value if value is None or self.rule is None else self.rule.convert(value)

    def fault(self, form: Form) -> str:
        """What is wrong with the number; empty if nothing is."""
        value = number_text.parse_number(form[self.name])
        if value is None or self.rule is None or (math.isfinite(value) and self.rule.is_valid(value)):
            return ""
        return gettext(self.rule.fault, text=form[self.name].strip())


_ANY = NumberRule(N_("{text} is no number. Write one, or leave it empty"))
_POSITIVE = NumberRule(
    N_("{text} is no number above 0. Write one in kg, or leave it empty"), lambda value: value > 0.0
)
_WHOLE = NumberRule(
    N_("{text} is no whole number, 0 or above. Write one, or leave it empty"),
    lambda value: value >= 0.0 and value == int(value),
    int,
)
_GAIN = NumberRule(
    N_("{text} is no number other than 0. A negative one turns the gauge"), lambda value: value != 0.0
)
_RATE = NumberRule(
    N_("{text} is no number above 0. Write rows a second, or leave it empty"), lambda value: value > 0.0
)
_SHARE = NumberRule(
    N_("{text} is no number, 0 or above. Write a share of the gain: 0.003 is 0.3 %"),
    lambda value: value >= 0.0,
)
_AS_NAMED = {"": N_("as the file says")}
_TIME_UNITS = _AS_NAMED | {"s": "s", "ms": "ms", "us": "µs"}
_LENGTH_UNITS = _AS_NAMED | {"m": "m", "mm": "mm", "um": "µm", GAIN: N_("by a gain")}
_MEASURES = {"relative": N_("plate against table"), "plate": N_("plate against base")}
_QUANTITIES = {
    "displacement": N_("displacement"),
    "velocity": N_("velocity"),
    "acceleration": N_("acceleration"),
}
_DETECT = {"": N_("find out")}
_DELIMITERS = _DETECT | {
    ",": N_("comma"), ";": N_("semicolon"), "\t": N_("tab"), " ": N_("blanks"), "|": "|"
}  # fmt: skip
_DECIMALS = _DETECT | {".": N_("point"), ",": N_("comma")}
ENCODINGS = _DETECT | {
    "utf-8": "UTF-8", "utf-16-le": "UTF-16 LE", "utf-16-be": "UTF-16 BE",
    "cp1251": N_("Windows-1251 (Cyrillic)"), "cp1252": N_("Windows-1252 (Western)"),
    "cp1250": N_("Windows-1250 (Central European)"), "cp1254": N_("Windows-1254 (Turkish)"),
    "cp866": N_("CP866 (Cyrillic, DOS)"), "koi8-r": N_("KOI8-R (Cyrillic)"),
}  # fmt: skip
"""Titles by the name in Python."""
_SIZES = {"": N_("ask where unlikely"), "yes": N_("take as they are")}
_DATE_ORDERS = _DETECT | {
    "dmy": N_("day, month, year"), "mdy": N_("month, day, year"), "ymd": N_("year, month, day")
}  # fmt: skip
_HEADERS = _DETECT | {"yes": N_("yes"), "no": N_("no")}
_CONDITION_HINTS = {
    "plate_id": N_("which one"),
    "contact_id": N_("which pair of surfaces"),
    "surface_preparation": N_("how prepared"),
}

_COLUMNS = (
    Field("time", N_("Time"), option="--time", choices={}),
    Field("rate", N_("Rows a second"), N_("only of a file without times"), "--rate", rule=_RATE),
    Field("time_unit", N_("Unit of time"), option="--time-unit", choices=_TIME_UNITS),
    Field("table", N_("Gauge 1, table"), choices={}),
    Field("second", N_("Gauge 2"), choices={}),
    Field("measures", N_("Gauge 2 measures"), choices=_MEASURES),
    Field("quantity", N_("Quantity"), choices=_QUANTITIES),
    Field("unit", N_("Unit"), option="--unit", choices=_LENGTH_UNITS),
    Field("gain", N_("Gain"), N_("1, reading of one unit of a cell"), "--gain", rule=_GAIN),
    Field("offset", N_("Offset"), N_("0, reading at a cell of 0"), "--offset", rule=_ANY),
    Field("unit_name", N_("Unit of the gain"), N_("m, unless something else: rad, V"), "--unit-name"),
)
_TEST = (
    Field("series", N_("Series"), N_("for example 1FFM0")),
    Field("plate_mass_kg", N_("Plate mass, kg"), N_("as the series says"), rule=_POSITIVE),
    Field("table_mass_kg", N_("Table mass, kg"), N_("as of the stand"), rule=_POSITIVE),
    Field("operator", N_("Operator"), N_("who recorded")),
    Field("note", N_("Note"), N_("kept with the run")),
)
_NAME = Field("name", N_("Name of the run"), N_("as of the file"))
_CALIBRATION = (
    Field(
        "gain_uncertainty", N_("Uncertainty of the gain"), N_("not stated; 0.003 is 0.3 %"),
        "--gain-uncertainty", rule=_SHARE,
    ),
    Field("any_size", N_("Displacements"), option="--any-size", choices=_SIZES),
)  # fmt: skip
_LINES = (
    Field("delimiter", N_("Between cells"), option="--delimiter", choices=_DELIMITERS),
    Field("decimal", N_("Decimal sign"), option="--decimal", choices=_DECIMALS),
    Field("header", N_("Names above"), option="--no-header", choices=_HEADERS),
    Field("skip", N_("Lines skipped"), "0", "--skip", rule=_WHOLE),
    Field("encoding", N_("Encoding"), option="--encoding", choices=ENCODINGS),
    Field("missing", N_("Absent readings"), N_("marks besides NaN, N/A, -: x; -9999"), "--missing"),
)
_DATES = (
    Field("begun", N_("Begun"), N_("as the file says; 2019-05-04 14:03:00+02:00"), "--begun"),
    Field("date", N_("Dates"), option="--date", choices={}),
    Field("date_order", N_("Dates are"), option="--date-order", choices=_DATE_ORDERS),
)
_PART = (
    Field("from_s", N_("From, s"), N_("the beginning"), "--from", rule=_ANY),
    Field("until_s", N_("Until, s"), N_("the end"), "--until", rule=_ANY),
    Field("segment", N_("Stretch"), N_("from 0, where times go back"), "--segment", rule=_WHOLE),
)
_CONDITIONS = (
    *(
        Field(name, title, _CONDITION_HINTS.get(name, N_("not known")))
        for name, title in CONDITION_TITLES.items()
    ),
    Field("other", N_("Others"), N_("name=text; name=text")),
)
GROUPS = {N_("Columns"): _COLUMNS, N_("Test"): _TEST}
RARE_GROUPS = {
    N_("Calibration and name"): (*_CALIBRATION, _NAME),
    N_("Date"): _DATES,
    N_("Lines"): _LINES,
    N_("Part"): _PART,
    N_("Conditions"): _CONDITIONS,
}
"""Groups under a fold."""
FIELDS = {field.name: field for group in (GROUPS | RARE_GROUPS).values() for field in group}
OPTION_FIELDS = {field.option: field.name for field in FIELDS.values() if field.option}
OPTION_LABELS = {
    field.option: message("“{label}”", label=Message(field.title))
    for field in FIELDS.values()
    if field.option
}
"""What the window shows for an option that a message names."""
COLUMN_FIELDS = ("time", "table", "second", "date")
"""Names of columns, as in `FilePreview.columns`."""
GAIN_FIELDS = ("gain", "offset", "unit_name")  # fields that hold only where `unit` is `GAIN`
LINE_FIELDS = tuple(field.name for field in _LINES)
PER_FILE_FIELDS = ("note", "run_in_number", "name", "begun", "delimiter", "decimal", "header")
"""Fields that are cleared for the next file, also for one of the same layout."""
CARRIED_LINE_FIELDS = ("skip", "encoding")
"""Fields without which the columns of a file like the last one may not be found."""
_METADATA_FIELDS = {field.name for field in (*_TEST, _NAME, *_CONDITIONS)}


def make_form(**texts: str) -> Form:
    """Make a form of the defaults and some other texts."""
    return {name: next(iter(field.choices or {}), "") for name, field in FIELDS.items()} | texts


def reads_alike(one: Form, other: Form | None) -> bool:
    """Whether both forms read a file the same way: they differ only in metadata of the run."""
    return other is not None and all(one[name] == other[name] for name in FIELDS.keys() - _METADATA_FIELDS)


def validate(form: Form) -> dict[str, str]:
    """Faults by name of the field; empty if there are none."""
    return dict(_faults(form))


def parse_pairs(text: str) -> Iterator[tuple[str, str]]:
    """Split `name=text; name=text`; name or text is empty where it is missing."""
    for part in filter(str.strip, text.split(";")):
        name, _, value = part.partition("=")
        yield name.strip(), value.strip()


def parse_time(text: str) -> datetime.datetime | None:
    """Read a date-time, in the zone of this computer unless it has one; None of none. Raises ValueError."""
    if not text.strip():
        return None
    time = datetime.datetime.fromisoformat(text.strip())
    return time if time.tzinfo else time.astimezone()


def _faults(form: Form) -> Iterator[tuple[str, str]]:
    for name, field in FIELDS.items():
        if (fault := field.fault(form)) and (name not in GAIN_FIELDS or form["unit"] == GAIN):
            yield name, fault
    first_s, last_s = FIELDS["from_s"].parse(form), FIELDS["until_s"].parse(form)
    if first_s is not None and last_s is not None and last_s <= first_s:
        text = form["until_s"].strip()
        yield "until_s", gettext("{text} is not after the first second. Write a later one", text=text)
    try:
        parse_time(form["begun"])
    except ValueError:
        text = form["begun"].strip()
        yield (
            "begun",
            gettext(
                "{text} is no time. Write it like 2019-05-04 14:03:00, with +02:00 for a zone", text=text
            ),
        )
    name = form["name"].strip()
    if name != PurePath(name).name:
        yield "name", gettext("{text} is no name of a file. Leave out / and \\", text=name)
    yield from _condition_faults(form)


def _condition_faults(form: Form) -> Iterator[tuple[str, str]]:
    for name in CONDITION_FIELDS:
        try:
            parse_conditions(form, {}, (name,))
        except ConditionError as error:
            yield name, translate(error.reason)
    other = dict(parse_pairs(form["other"]))
    try:
        parse_conditions(form, other, ())
    except ConditionError as error:
        yield "other", translate(error.reason)
    except MetadataError as error:
        yield "other", translate(error.message)
    if not all(name and text for name, text in other.items()):
        text = form["other"].strip()
        yield "other", gettext("{text} is no condition. Write name=text, and ; between them", text=text)
