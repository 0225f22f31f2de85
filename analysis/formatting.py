"""Lengths and other numbers as messages show them: few digits, a unit, and never an exponent."""

import numpy as np

_SMALL_M = 0.9995e-3
"""Three digits of it are still less than 1000 µm."""
_LARGE_M = 0.5


def format_number(value: float, digits: int = 3) -> str:
    """`value` to `digits` significant digits, without an exponent and without zeros at the end."""
    return np.format_float_positional(
        value + 0.0,  # no minus before 0
        precision=digits, unique=False, fractional=False, trim="-",
    )  # fmt: skip


def format_length(value_m: float) -> str:
    """`value_m` (m) with its unit: µm below 1 mm, mm to the hundredth below half a metre, then m."""
    if abs(value_m) < _SMALL_M:
        return f"{format_number(value_m * 1e6)} µm"
    if abs(value_m) < _LARGE_M:
        return f"{value_m * 1e3:.2f} mm"
    return f"{format_number(value_m)} m"


def format_with_unit(value: float, unit: str) -> str:
    """`value` with its unit; lengths in m as `length` shows them."""
    return format_length(value) if unit == "m" else f"{format_number(value)} {unit}"
