"""Units that a foreign file names: behind the name of a column, in a row of their own, or as an attribute."""

import re
from dataclasses import dataclass

from app.runs.metadata import Quantity

_PREFIXES = {"": 1.0, "n": 1e-9, "u": 1e-6, "m": 1e-3, "c": 1e-2, "d": 1e-1, "k": 1e3}
_LENGTHS = {prefix + "m": _PREFIXES[prefix] for prefix in ("", "n", "u", "m", "c", "d")}
_TIMES = {prefix + "s": _PREFIXES[prefix] for prefix in ("", "n", "u", "m")} | {
    "sec": 1.0, "second": 1.0, "seconds": 1.0, "msec": 1e-3, "usec": 1e-6, "min": 60.0, "h": 3600.0,
    "hr": 3600.0,
}  # fmt: skip
_INCH_M = 0.0254
_STANDARD_GRAVITY = 9.80665  # m/s^2, of which `g` is the unit in records of accelerometers (ISO 80000-3)
_OTHERS = re.compile(
    r"[munk]?v|[mu]?v/v|[mu]?a|counts?|cts|digits?|lsb|adc|ppm|%|[munk]?strain|u?[mε]/m|ε|[mkd]?n|kgf?|[mk]?hz"
    r"|full scale|m?rad|deg|°|[mk]?pa|bar|°?c|ft|raw|в|мв|мв/в",
    re.IGNORECASE,
)
_PLAIN = str.maketrans({"µ": "u", "μ": "u", "²": "2", "·": "*", "−": "-", "^": None, " ": None})
_RUSSIAN = {
    "с": "s", "сек": "s", "мс": "ms", "мкс": "us", "мин": "min", "ч": "h", "м": "m", "мм": "mm", "мкм": "um",
    "см": "cm", "м/с": "m/s", "мм/с": "mm/s", "м/с2": "m/s2", "мм/с2": "mm/s2",
}  # fmt: skip
_BEHIND = re.compile(r"[\[({<]\s*([^\[\](){}<>]{1,12}?)\s*[\])}>]\s*$")
_AFTER = re.compile(r"(?:,|\s/|_|:|\bin)\s*([^\s,_/]{1,8}(?:/[^\s,_/]{1,4})?)\s*$")
_APART = re.compile(r"\s(мм|мкм|мс|[mnuµμ]m|cm|[mnuµμ]s|sec)\s*$")
"""Units that are no words: `gauge in`, `u1 min` and `channel s` are names."""


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit that a file names."""

    text: str
    quantity: Quantity | None
    """None of a unit of something else, such as volts."""
    scale: float
    """What one of it is in m, m/s or m/s^2; in s for a time."""
    is_time: bool = False


def parse_unit(text: str) -> Unit | None:
    """Read a unit; None for a text that is none."""
    bare = text.strip().strip("[](){}<>").strip()
    plain = bare if bare == "full scale" else bare.translate(_PLAIN)
    plain = _RUSSIAN.get(plain.lower(), plain)
    if plain in _TIMES:
        return Unit(bare, None, _TIMES[plain], is_time=True)
    if plain in _LENGTHS:
        return Unit(bare, "displacement", _LENGTHS[plain])
    if plain.lower() in ("in", "inch", '"'):
        return Unit(bare, "displacement", _INCH_M)
    length, _, rest = plain.partition("/")
    if length in _LENGTHS and rest in ("s", "s2", "s/s", "s**2"):
        return Unit(bare, "velocity" if rest == "s" else "acceleration", _LENGTHS[length])
    if plain == "g":
        return Unit(bare, "acceleration", _STANDARD_GRAVITY)
    return Unit(bare, None, 1.0) if _OTHERS.fullmatch(plain) else None


def unit_in_name(name: str) -> str:
    """Unit behind the name of a column: `t (ms)`, `u1 [mm]`, `u1, mm`, `u1 mm`, `u1_mm`; "" without one."""
    found = _BEHIND.search(name)
    if found is not None:
        return found[1] if parse_unit(found[1]) else ""
    found = _AFTER.search(name) or _APART.search(name)
    unit = parse_unit(found[1]) if found else None
    # Without brackets only times and lengths are units: `u_g` or `x_n` are names.
    is_plain = unit is not None and (unit.is_time or unit.quantity == "displacement") and unit.text != "h"
    return unit.text if unit is not None and is_plain else ""
