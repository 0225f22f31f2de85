"""Numbers as they are printed: two digits of uncertainty, the value to the same digit, a true minus sign."""

import math
import re

MINUS = "\u2212"
_OF_NUMBER = re.compile(r"(?<![^\s(])-(?=\d)")
"""A hyphen that stands for a minus sign, not one within a name."""
_FINEST = 1e-8
_PREFIXES = ("", "m", "µ", "n", "p")


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


def two_digits(value: float) -> str:
    """Write an uncertainty by itself: `120`, `0.64`, `0.00011`, `2.8e−10`."""
    if not 1e-5 <= abs(value) < 1e9:
        return compact(value, 2)
    return value_and_uncertainty(0.0, abs(value))[1]


def compact(value: float, digits: int) -> str:
    """Write a number of any size: `12000`, `2e−9`."""
    mantissa, _, power = f"{value:.{digits}g}".partition("e")
    return signed(f"{mantissa}e{int(power)}" if power else mantissa)


def with_prefix(value: float, unit: str, digits: int) -> str:
    """Write a number in the unit with the prefix that suits it: `2 nm`, `−4.05 µV`."""
    power = 0 if value == 0.0 else min(max(math.floor(math.log10(abs(value)) / 3.0), -4), 0)
    return f"{compact(value * 10.0 ** (-3 * power), digits)}\u00a0{_PREFIXES[-power]}{unit}"


def fixed(value: float, decimals: int) -> str:
    """Write a number with fixed decimals (negative ones round to tens), and never `-0`."""
    shown = round(value, decimals) + 0.0
    return signed(f"{shown:.{max(decimals, 0)}f}")


def signed(text: str) -> str:
    """Put a true minus sign in place of the hyphen."""
    return text.replace("-", MINUS)


def signed_numbers(text: str) -> str:
    """Put a true minus sign before the numbers of a sentence."""
    return _OF_NUMBER.sub(MINUS, text)
