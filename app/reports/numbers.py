"""Numbers as they are printed: two digits of uncertainty, the value to the same digit, a true minus sign."""

import math

MINUS = "\u2212"
_FINEST = 1e-8


def value_and_uncertainty(value: float, uncertainty: float) -> tuple[str, str]:
    """Write `0.10030` and `0.00064`; without an uncertainty to speak of, six digits and nothing."""
    if not (math.isfinite(uncertainty) and uncertainty > _FINEST * abs(value)):
        return signed(f"{value:.6g}"), ""
    decimals = 1 - math.floor(math.log10(uncertainty))
    decimals -= round(uncertainty, decimals) >= 10.0 ** (2 - decimals)  # 0.0996 becomes 0.10, not 0.100
    return fixed(value, decimals), fixed(uncertainty, decimals)


def with_uncertainty(value: float, uncertainty: float, unit: str = "") -> str:
    """Write `0.10030 ± 0.00064 m/s`, with spaces at which no line breaks."""
    shown = "\u00a0±\u00a0".join(filter(None, value_and_uncertainty(value, uncertainty)))
    return f"{shown}\u00a0{unit}" if unit else shown


def fixed(value: float, decimals: int) -> str:
    """Write a number with fixed decimals (negative ones round to tens), and never `-0`."""
    shown = round(value, decimals) + 0.0
    return signed(f"{shown:.{max(decimals, 0)}f}")


def signed(text: str) -> str:
    """Put a true minus sign in place of the hyphen."""
    return text.replace("-", MINUS)
