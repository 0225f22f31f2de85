"""Numbers as text: the only module that rounds for display.

A value with its standard uncertainty follows JCGM 100, 7.2.6: two significant digits of the uncertainty,
the value to the same place, no negative zero. `typeset` puts true minus signs for window and print; the
command line and files keep the hyphen.
"""

import math
import re
from dataclasses import dataclass
from decimal import Decimal

MINUS = "\u2212"
THIN_SPACE = "\u202f"
NO_BREAK_SPACE = "\u00a0"
_NEGLIGIBLE = 1e-9  # relative uncertainty below which only rounding errors of a simulated record remain
_DIGITS, _DIGITS_OF_EXACT = 6, 9
"""Significant digits of a value without an uncertainty, and of one whose uncertainty is negligible."""
_SMALL_M = 0.9995e-3  # three digits of it are still less than 1000 µm
_LARGE_M = 0.5
_FIXED_POINT = 1e-5, 1e9  # sizes that are written without an exponent
_HYPHEN_OF_NUMBER = re.compile(r"(?<![^\s(])-(?=\d)")  # a minus sign, no hyphen of a name
_UNITS = "°C|[mµn]?m|[mµn]?s|min|k?g|[kM]?N|[kM]?Hz|rad|[kMG]B|мк?м|мк?с|с|мин|к?г|к?Н|[км]?Гц|рад"
_INSIDE_VALUE = re.compile(
    rf"(?<=\d) (?=±|%|(?:{_UNITS})\b)|(?<=±) (?=\d)|(?<=\bp) (?=[=<>])|(?<=\bp [=<>]) (?=\d)"
)
_PREFIXES = ("", "m", "µ", "n", "p")


@dataclass(frozen=True, slots=True)
class FormattedValue:
    """A value and its standard uncertainty, rounded to the same decimal place."""

    value: str
    uncertainty: str = ""  # "" where it is unknown or negligible
    unit: str = ""  # "" for pure numbers

    def __str__(self) -> str:
        """`0.10030 ± 0.00064 m/s`."""
        return " ".join(filter(None, (self.value, self.uncertainty and f"± {self.uncertainty}", self.unit)))

    @property
    def in_print(self) -> str:
        """The same with true minus signs, and spaces at which no line breaks."""
        return typeset(str(self)).replace(" ", NO_BREAK_SPACE)

    @property
    def latex(self) -> str:
        r"""`$0.10030 \pm 0.00064$`, without unit."""
        return f"${self.value} \\pm {self.uncertainty}$" if self.uncertainty else f"${self.value}$"


def format_value(value: float, uncertainty: float | None, unit: str = "") -> FormattedValue:
    """Round a value and its standard uncertainty to the same place, two digits of the uncertainty.

    An uncertainty that is not stated (None, 0, NaN) or not finite is left out, and the value has six
    significant digits; beside a negligible one it has nine.
    """
    if uncertainty is None or not (math.isfinite(value) and 0.0 < uncertainty < math.inf):
        return FormattedValue(_significant(value, _DIGITS), "", unit)
    if uncertainty <= _NEGLIGIBLE * abs(value):
        return FormattedValue(_significant(value, _DIGITS_OF_EXACT), "", unit)
    decimals = uncertainty_decimals(uncertainty)
    return FormattedValue(format_fixed(value, decimals), format_fixed(uncertainty, decimals), unit)


def format_concise(value: float, uncertainty: float) -> str:
    """Write `0.10030(64)`: the standard uncertainty in units of the last digits (JCGM 100, 7.2.2)."""
    formatted = format_value(value, uncertainty)
    if not formatted.uncertainty:
        return formatted.value
    decimals = uncertainty_decimals(uncertainty)
    digits = formatted.uncertainty if decimals < 2 else str(round(uncertainty * 10.0**decimals))
    return f"{formatted.value}({digits})"


def format_interval(low: float, high: float) -> str:
    """Write both ends of an interval to two digits of a quarter of its width: `0.0991 to 0.1009`.

    A quarter of a 95 % interval is about a standard uncertainty. A dash where an end is not finite.
    """
    if not (math.isfinite(low) and math.isfinite(high)):
        return "–"
    spread = (high - low) / 4.0
    return " to ".join(format_value(end, spread).value for end in (low, high))


def format_uncertainty(uncertainty: float) -> str:
    """Write an uncertainty by itself, with two digits: `120`, `0.64`, `0.00011`, `2.8e-10`."""
    least, most = _FIXED_POINT
    if not least <= abs(uncertainty) < most:
        mantissa, _, power = f"{abs(uncertainty):.1e}".partition("e")
        return f"{mantissa}e{int(power)}" if uncertainty else "0"
    return format_fixed(abs(uncertainty), uncertainty_decimals(abs(uncertainty)))


def uncertainty_decimals(uncertainty: float) -> int:
    """Decimals that show two digits of an uncertainty above 0; negative for tens. 0.0996 becomes 0.10."""
    decimals = 1 - math.floor(math.log10(uncertainty))
    return decimals - (round(uncertainty, decimals) >= 10.0 ** (2 - decimals))


def format_fixed(value: float, decimals: int) -> str:
    """Write a number with fixed decimals (negative ones round to tens), and never `-0`."""
    return f"{round(value, decimals) + 0.0:.{max(decimals, 0)}f}"


def format_signed(value: float, decimals: int) -> str:
    """Write a difference with its sign and fixed decimals: `+0.12`."""
    return f"{round(value, decimals) + 0.0:+.{max(decimals, 0)}f}"


def format_compact(value: float, digits: int) -> str:
    """Write a number of any size with few digits: `12000`, `2e-9`."""
    mantissa, _, power = f"{value:.{digits}g}".partition("e")
    return f"{mantissa}e{int(power)}" if power else mantissa


def format_with_prefix(value: float, unit: str, digits: int) -> str:
    """Write a number in the unit with the prefix that suits it: `2 nm`, `-4.05 µV`."""
    power = 0 if value == 0.0 else min(max(math.floor(math.log10(abs(value)) / 3.0), -4), 0)
    return f"{format_compact(value * 10.0 ** (-3 * power), digits)}{NO_BREAK_SPACE}{_PREFIXES[-power]}{unit}"


def format_number(value: float, digits: int = 3) -> str:
    """Write a number with some significant digits, without an exponent and without zeros at the end."""
    if not math.isfinite(value):
        return str(value)
    text = format(Decimal(f"{value + 0.0:.{digits - 1}e}"), "f")  # + 0.0: no minus before 0
    return text.rstrip("0").rstrip(".") if "." in text else text


def format_length(value_m: float) -> str:
    """Write a length (m) with its unit: µm below 1 mm, mm to the hundredth below half a metre, then m."""
    if abs(value_m) < _SMALL_M:
        return f"{format_number(value_m * 1e6)} µm"
    if abs(value_m) < _LARGE_M:
        return f"{value_m * 1e3:.2f} mm"
    return f"{format_number(value_m)} m"


def format_with_unit(value: float, unit: str) -> str:
    """Write a value with its unit; lengths in m as `format_length` does."""
    return format_length(value) if unit == "m" else f"{format_number(value)} {unit}"


def with_unit(text: str, unit: str) -> str:
    """Join a number and its unit by a thin space that does not break; `1/s` needs a wider one."""
    if not unit:
        return text
    return f"{text}{NO_BREAK_SPACE if unit[0].isdigit() else THIN_SPACE}{unit}"


def typeset(text: str) -> str:
    """Put true minus signs into a number."""
    return text.replace("-", MINUS)


def typeset_sentence(text: str) -> str:
    """Put true minus signs before the numbers of a sentence; hyphens of words stay."""
    return _HYPHEN_OF_NUMBER.sub(MINUS, text)


def unbreakable(text: str) -> str:
    """Let no line of a sentence end before ±, %, or a unit, or after ±."""
    return _INSIDE_VALUE.sub(NO_BREAK_SPACE, text)


def _significant(value: float, digits: int) -> str:
    return f"{value + 0.0:.{digits}g}"
