"""Form of the import dialog, and its validation."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from pathlib import PurePath

from app.presenters import number_text
from app.presenters.conditions import CONDITION_FIELDS, parse_conditions
from app.runs.errors import ConditionError, MetadataError
from messages.i18n import N_, gettext, translate

GAIN = "gain"
"""Choice of `unit` for a gain instead."""


@dataclass(frozen=True, slots=True)
class TextFormat:
    """Format of a text file, as typed; empty fields are detected."""

    delimiter: str = ""
    decimal: str = ""
    skip: str = ""
    header: str = ""
    """`yes` or `no`."""


@dataclass(frozen=True, slots=True)
class ImportForm:
    """Fields of the dialog, as typed. Columns are named as in `FilePreview.columns`."""

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
    """Name of the run; empty: that of the file."""


PER_FILE_FIELDS = ("note", "run_in_number", "name")
"""Fields that are cleared for the next file."""
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
"""Fields that do not affect how a file is read."""

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
NUMBER_RULES: dict[str, _Number] = {
    "skip": _WHOLE, "gain": _GAIN, "offset": _ANY, "gain_uncertainty": _SHARE, "from_s": _ANY,
    "until_s": _ANY, "segment": _WHOLE, "plate_mass_kg": _POSITIVE, "table_mass_kg": _POSITIVE,
}  # fmt: skip
"""For each number: message if it is invalid, and its condition."""
NUMBER_FIELDS = tuple(name for name in NUMBER_RULES if name != "skip")
"""Numbers of `ImportForm` itself; `skip` belongs to its `TextFormat`."""
_WITH_GAIN = ("gain", "offset", "unit_name")


def validate(form: ImportForm) -> dict[str, str]:
    """Faults by name of the field; empty if there are none."""
    return dict(_faults(form))


def parse_pairs(text: str) -> Iterator[tuple[str, str]]:
    """Split `name=text; name=text`; name or text is empty where it is missing."""
    for part in filter(str.strip, text.split(";")):
        name, _, said = part.partition("=")
        yield name.strip(), said.strip()


def _faults(form: ImportForm) -> Iterator[tuple[str, str]]:
    typed = {field.name: getattr(form, field.name) for field in fields(form)} | {
        "skip": form.text_format.skip
    }
    for name, (words, is_right) in NUMBER_RULES.items():
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
        except ConditionError as error:
            yield name, translate(error.reason)
    if not all(name and text for name, text in parse_pairs(form.other)):
        words = gettext(
            "{text} is no condition. Write name=text, and ; between them", text=form.other.strip()
        )
        yield "other", words
        return
    try:
        parse_conditions(form, dict(parse_pairs(form.other)), ())
    except ConditionError as error:
        yield "other", translate(error.reason)
    except MetadataError as error:
        yield "other", translate(error.message)
