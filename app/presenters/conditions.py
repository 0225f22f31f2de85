"""Conditions of a test as typed on Record and in an import."""

from collections.abc import Mapping, Sequence

from app.presenters import number_text
from app.runs.metadata import Conditions
from messages.i18n import N_

CONDITION_TITLES = {
    "temperature_c": N_("Temperature, °C"),
    "humidity_percent": N_("Humidity, %"),
    "plate_id": N_("Plate"),
    "contact_id": N_("Contact"),
    "surface_preparation": N_("Surfaces"),
    "run_in_number": N_("Run-in number"),
}
"""By the field names of `Conditions`, in the order of the forms."""
CONDITION_FIELDS = tuple(CONDITION_TITLES)
_NUMBERS = ("temperature_c", "humidity_percent")


def parse_conditions(
    form: Mapping[str, str], other: Mapping[str, str], names: Sequence[str] = CONDITION_FIELDS
) -> Conditions:
    """Parse fields of `form` by these names, and add `other` conditions. Raises MetadataError."""
    texts = {name: form[name].strip() for name in names}
    texts |= {name: number_text.normalize_number(texts[name]) for name in _NUMBERS if name in texts}
    known = Conditions.parse({name: text for name, text in texts.items() if text})
    return known.replace(other=dict(other))
