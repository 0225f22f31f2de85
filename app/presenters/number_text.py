"""Numbers as people read them: uncertainty to two digits, value to the same digit, thin spaces."""

import math

from analysis.quantities import Quantity

THIN_SPACE = "\u202f"
NO_BREAK_SPACE = "\u00a0"
MINUS = "\u2212"
_FINEST = 1e-8


def normalize_number(text: str) -> str:
    """What a person typed, as Python reads it: a decimal comma and a true minus are fine."""
    return text.strip().replace(",", ".").replace(MINUS, "-")


def parse_number(text: str) -> float | None:
    """Read a number that a person typed: None where nothing is, NaN where it is no finite number."""
    if not text.strip():
        return None
    try:
        value = float(normalize_number(text))
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan


def format_uncertain(quantity: Quantity, scale: float = 1.0) -> tuple[str, str]:
    """Write `0.10030` and `0.00064`; without an uncertainty to speak of, six digits and nothing.

    Parameters
    ----------
    quantity : Quantity
    scale : float
        How many of the shown unit make one of the quantity's own.
    """
    value, uncertainty = quantity.value * scale, quantity.standard_uncertainty * scale
    if not (math.isfinite(value) and math.isfinite(uncertainty) and uncertainty > 0.0):
        return with_minus_sign(f"{value:.6g}"), ""
    if uncertainty < _FINEST * abs(value):  # of a simulated record without noise
        return with_minus_sign(f"{value:.9g}"), f"{uncertainty:.0e}"
    decimals = uncertainty_decimals(uncertainty)
    return format_fixed(value, decimals), format_fixed(uncertainty, decimals)


def with_unit(text: str, unit: str) -> str:
    """Join a number and its unit by a thin space that does not break; `1/s` needs a wider one."""
    if not unit:
        return text
    return f"{text}{NO_BREAK_SPACE if unit[0].isdigit() else THIN_SPACE}{unit}"


def format_millimetres(value_m: float, decimals: int = 1) -> str:
    """Write a length (m) in millimetres, without unit; a dash where there is none."""
    return format_fixed(value_m * 1e3, decimals) if math.isfinite(value_m) else "–"


def format_fixed(value: float, decimals: int) -> str:
    """Write a number with fixed decimals (negative ones round to tens), a true minus, and never `-0`."""
    shown = round(value, decimals) + 0.0
    return with_minus_sign(f"{shown:.{max(decimals, 0)}f}")


def with_minus_sign(text: str) -> str:
    """Put a true minus sign in place of the hyphen."""
    return text.replace("-", MINUS)


def format_file_size(size_bytes: int) -> str:
    """Write a disk size for people: `210 GB`, `0.4 GB`, `12 MB`."""
    size_gb = size_bytes / 1e9
    if size_gb < 0.1:
        return with_unit(format_fixed(size_bytes / 1e6, 0), "MB")
    return with_unit(format_fixed(size_gb, 0 if size_gb >= 10.0 else 1), "GB")


def uncertainty_decimals(standard_uncertainty: float) -> int:
    """Decimals that show two digits of an uncertainty; 0.0996 becomes 0.10, not 0.100."""
    decimals = 1 - math.floor(math.log10(standard_uncertainty))
    return decimals - (round(standard_uncertainty, decimals) >= 10.0 ** (2 - decimals))
