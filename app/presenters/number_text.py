"""Numbers in the window: true minus signs, thin spaces, and numbers as typed."""

import math

from analysis import formatting
from analysis.catalogue import Unit, displacement_decimals, displacement_unit
from analysis.formatting import MINUS, format_value, typeset, with_unit
from analysis.quantities import Quantity
from messages.message import MessageError


def normalize_number(text: str) -> str:
    """Convert a typed number to Python's form: a decimal comma and a true minus sign are accepted."""
    return text.strip().replace(",", ".").replace(MINUS, "-")


def parse_number(text: str) -> float | None:
    """Read a typed number: None for an empty text, NaN for one that is no finite number."""
    if not text.strip():
        return None
    try:
        value = float(normalize_number(text))
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan


class FormError(MessageError, ValueError):
    """A field of a form cannot be used; the message names field, value and remedy."""


def parse_field(text: str, name: str, scale: float = 1.0) -> float | None:
    """Read the field `name` of a form in `scale` per unit; None if it is empty. Raises FormError."""
    value = parse_number(text)
    if value is not None and math.isnan(value):
        raise FormError(
            "{name} {text!r} is not a number: write one, or leave it empty", name=name, text=text.strip()
        )
    return None if value is None else value / scale


def format_uncertain(quantity: Quantity) -> tuple[str, str]:
    """Write value and uncertainty to the same digit."""
    formatted = format_value(quantity.value, quantity.standard_uncertainty)
    return typeset(formatted.value), formatted.uncertainty


def format_in(unit: Unit, value: float, decimals: int = 1) -> str:
    """Write an SI value with its unit; a dash for NaN."""
    return with_unit(typeset(unit.number(value, decimals)), unit.symbol)


def displacement_number(value_m: float, decimals: int = 1) -> str:
    """Write a displacement (m) in the unit of the screens, to so many `decimals` of a millimetre."""
    return typeset(displacement_unit().number(value_m, displacement_decimals(decimals)))


def format_displacement(value_m: float, decimals: int = 1) -> str:
    """Write a displacement (m) with the unit of the screens, as `displacement_number`."""
    return with_unit(displacement_number(value_m, decimals), displacement_unit().symbol)


def format_fixed(value: float, decimals: int) -> str:
    """Write a number with fixed decimals (negative ones round to tens), a true minus, and never `-0`."""
    return typeset(formatting.format_fixed(value, decimals))


def format_file_size(size_bytes: int) -> str:
    """Write a disk size for people: `210 GB`, `0.4 GB`, `12 MB`."""
    size_gb = size_bytes / 1e9
    if size_gb < 0.1:
        return with_unit(format_fixed(size_bytes / 1e6, 0), "MB")
    return with_unit(format_fixed(size_gb, 0 if size_gb >= 10.0 else 1), "GB")
