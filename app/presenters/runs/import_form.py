"""What the operator fills in to import a file, what is wrong with it, and the request made of it.

The request is that of `slipstand import`: a `CsvImport`, and the facts of the run.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

from app.presenters import number_text
from app.presenters.conditions import CONDITION_FIELDS, parse_conditions
from messages.i18n import N_, gettext, translate

if TYPE_CHECKING:
    from app.runs.exchange.importing import CsvImport
    from app.runs.exchange.preview import ParseOptions

GAIN = "gain"
"""Unit of who gives a gain instead."""


@dataclass(frozen=True, slots=True)
class TextFormat:
    """How the lines of a text are read, as typed; empty finds it out."""

    delimiter: str = ""
    decimal: str = ""
    skip: str = ""
    header: str = ""
    """`yes` or `no`."""


@dataclass(frozen=True, slots=True)
class ImportForm:
    """What the operator has filled in, as typed. Columns as `Survey.columns` calls them."""

    text_format: TextFormat = TextFormat()
    time: str = ""
    table: str = ""
    second: str = ""
    measures: str = "relative"
    time_unit: str = "s"
    unit: str = "m"
    gain: str = ""
    offset: str = ""
    unit_name: str = ""
    gain_uncertainty: str = ""
    quantity: str = "displacement"
    from_s: str = ""
    until_s: str = ""
    segment: str = ""
    series: str = ""
    plate_mass_kg: str = ""
    table_mass_kg: str = ""
    operator: str = ""
    note: str = ""
    temperature_c: str = ""
    humidity_percent: str = ""
    plate_id: str = ""
    contact_id: str = ""
    surface_preparation: str = ""
    run_in_number: str = ""
    other: str = ""
    """Other conditions, as `name=text; name=text`."""
    name: str = ""
    """Of the run; empty is that of the file."""


PER_FILE_FIELDS = ("note", "run_in_number", "name")
"""What is not the same in the next file."""
METADATA_FIELDS = (
    "series",
    "plate_mass_kg",
    "table_mass_kg",
    "operator",
    "note",
    *CONDITION_FIELDS,
    "other",
    "name",
)
"""What makes no difference to how a file is read."""

_Number = tuple[str, Callable[[float], bool]]
_ANY: _Number = (N_("{text} is no number. Write one, or leave it empty"), lambda _: True)
_POSITIVE: _Number = (
    N_("{text} is no number above 0. Write one in kg, or leave it empty"),
    lambda value: value > 0.0,
)
_WHOLE: _Number = (
    N_("{text} is no whole number, 0 or above. Write one, or leave it empty"),
    lambda value: value >= 0.0 and value == int(value),
)
_GAIN: _Number = (
    N_("{text} is no number other than 0. A negative one turns the gauge"),
    lambda value: value != 0.0,
)
_SHARE: _Number = (
    N_("{text} is no number, 0 or above. Write a share of the gain: 0.003 is 0.3 %"),
    lambda value: value >= 0.0,
)
_NUMBERS: dict[str, _Number] = {
    "skip": _WHOLE, "gain": _GAIN, "offset": _ANY, "gain_uncertainty": _SHARE, "from_s": _ANY,
    "until_s": _ANY, "segment": _WHOLE, "plate_mass_kg": _POSITIVE, "table_mass_kg": _POSITIVE,
}  # fmt: skip
"""What a number must be: the words where it is not, and whether it is."""
_WITH_GAIN = ("gain", "offset", "unit_name")


def validate(form: ImportForm) -> dict[str, str]:
    """What is wrong with what was typed, in words, by the name of the field; empty if nothing is."""
    return dict(_faults(form))


def survey_options(reading: TextFormat) -> "ParseOptions":
    """How the lines are to be read, as `survey` takes it; `skip` has no faults."""
    import msgspec

    from app.runs.exchange.preview import ParseOptions

    lines = {
        "delimiter": reading.delimiter or None,
        "decimal": reading.decimal or None,
        "skip": int(number_text.parse_number(reading.skip) or 0),
        "header": {"yes": True, "no": False}.get(reading.header),
    }
    return msgspec.convert(lines, ParseOptions)


def csv_import(form: ImportForm) -> "CsvImport":
    """How the file is to be read, as `slipstand import` says it; `form` has no faults."""
    import msgspec

    from app.runs.exchange.importing import CsvImport

    lines, is_gain = survey_options(form.text_format), form.unit == GAIN
    number = {name: number_text.parse_number(getattr(form, name)) for name in _NUMBERS if name != "skip"}
    segment = number["segment"]
    return msgspec.convert(
        {
            "layout": {
                "time": form.time, "table": form.table, "second": form.second or None,
                "delimiter": lines.delimiter, "decimal": lines.decimal or ".", "skip": lines.skip,
                "header": lines.header is not False,
            },
            "measures": form.measures, "time_unit": form.time_unit, "quantity": form.quantity,
            "unit": None if is_gain else form.unit,
            "gain": (number["gain"] or 1.0) if is_gain else None,
            "offset": (number["offset"] or 0.0) if is_gain else 0.0,
            "unit_name": (form.unit_name.strip() or None) if is_gain else None,
            "gain_uncertainty": number["gain_uncertainty"],
            "from_s": number["from_s"], "until_s": number["until_s"],
            "segment": None if segment is None else int(segment),
        },
        CsvImport,
    )  # fmt: skip


def run_metadata(form: ImportForm) -> dict[str, Any]:
    """Facts of the run, as `import_csv` takes them; `form` has no faults."""
    return {
        "series": form.series.strip() or None,
        "plate_mass_kg": number_text.parse_number(form.plate_mass_kg),
        "table_mass_kg": number_text.parse_number(form.table_mass_kg),
        "operator": form.operator.strip(),
        "note": form.note.strip(),
        "conditions": parse_conditions(form, dict(_pairs(form.other))),
    }


def _faults(form: ImportForm) -> Iterator[tuple[str, str]]:
    typed = {field.name: getattr(form, field.name) for field in fields(form)} | {
        "skip": form.text_format.skip
    }
    for name, (words, is_right) in _NUMBERS.items():
        value = number_text.parse_number(typed[name])
        if name in _WITH_GAIN and form.unit != GAIN:
            continue
        if value is not None and not (math.isfinite(value) and is_right(value)):
            yield name, gettext(words, text=typed[name].strip())
    first, last = (number_text.parse_number(text) for text in (form.from_s, form.until_s))
    if first is not None and last is not None and last <= first:
        yield (
            "until_s",
            gettext("{text} is not after the first second. Write a later one", text=form.until_s.strip()),
        )
    if form.name.strip() != PurePath(form.name.strip()).name:
        yield "name", gettext("{text} is no name of a file. Leave out / and \\", text=form.name.strip())
    yield from _faults_of_conditions(form)


def _faults_of_conditions(form: ImportForm) -> Iterator[tuple[str, str]]:
    for name in CONDITION_FIELDS:
        try:
            parse_conditions(form, {}, (name,))
        except ValueError as error:
            yield name, _told_at_field(error)
    if not all(name and text for name, text in _pairs(form.other)):
        words = gettext(
            "{text} is no condition. Write name=text, and ; between them", text=form.other.strip()
        )
        yield "other", words
        return
    try:
        parse_conditions(form, dict(_pairs(form.other)), ())
    except ValueError as error:
        yield "other", _told_at_field(error)


def _told_at_field(error: ValueError) -> str:
    """Leave out the name of the condition, which stands beside its field."""
    words = translate(str(error))
    return words.partition(" = ")[2] or words


def _pairs(text: str) -> Iterator[tuple[str, str]]:
    """Names and texts of `name=text; name=text`; what is none of these lacks one of them."""
    for part in filter(str.strip, text.split(";")):
        name, _, said = part.partition("=")
        yield name.strip(), said.strip()
