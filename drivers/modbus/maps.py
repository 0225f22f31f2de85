"""Register maps: which registers of which unit hold what, read from TOML and checked key by key."""

import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from drivers.errors import SettingsError
from drivers.modbus.frames import MAX_UNIT, READ_FUNCTIONS, WRITE_FUNCTIONS, Function
from drivers.modbus.registers import (
    WORD_BITS,
    ByteOrder,
    Channel,
    Status,
    ValueType,
    ZeroCommand,
)

GAUGES = ("table", "relative")
_LAST_REGISTER = 0xFFFF
_TEXTS = ("title", "source", "caution")
_PACKAGE = "drivers.modbus"


@dataclass(frozen=True, slots=True)
class RegisterMap:
    """A transmitter, or two on one bus.

    Attributes
    ----------
    name : str
        As it was asked for.
    title : str
        For people.
    caution : str
        What every run that is read by this map must say; "" for nothing.
    channels : dict of str to Channel
        Of the gauges `table` and `relative`, or of one of them.
    """

    name: str
    title: str
    caution: str
    channels: dict[str, Channel]


@dataclass(frozen=True, slots=True)
class _Value:
    """A value as it was given, and where."""

    value: Any
    where: str


def shipped_maps() -> list[str]:
    """Names of the maps that come with the driver."""
    folder = files(_PACKAGE).joinpath("maps")
    return sorted(entry.name[: -len(".toml")] for entry in folder.iterdir() if entry.name.endswith(".toml"))


def map_keys() -> list[str]:
    """Keys of a map that `--set` may give for both gauges, or with `table_` or `relative_` for one."""
    return list(_PARSERS)


def is_map_key(key: str) -> bool:
    """Whether a setting is one of a map."""
    return any(key.removeprefix(f"{gauge}_") in _PARSERS for gauge in GAUGES)


def read_map(name: str, given: Mapping[str, str], gauges: tuple[str, ...] = GAUGES) -> RegisterMap:
    """A shipped map or one in a file, with what was given on top of it.

    Parameters
    ----------
    name : str
        Of a shipped map, or a file that ends in `.toml`.
    given : mapping
        Values by key: `register` for both gauges, `table_register` for one.
    gauges : tuple of str
        Those to read: `table`, `relative` or both.

    Raises
    ------
    SettingsError
        In one line that names file, key, value and remedy.
    """
    where, content = _content(name)
    _check_keys(where, content)
    texts = {key: _text(where, key, content.get(key, "")) for key in _TEXTS}
    channels = {gauge: _channel(gauge, _values(where, content, given, gauge), where) for gauge in gauges}
    return RegisterMap(name, texts["title"] or name, texts["caution"], channels)


def _content(name: str) -> tuple[str, dict[str, Any]]:
    path: Any = Path(name).expanduser()
    if path.suffix != ".toml":
        if name not in shipped_maps():
            raise SettingsError(
                f"map {name!r} is not known: give one of {', '.join(shipped_maps())}, or a file of your own"
                " that ends in .toml"
            )
        path = files(_PACKAGE).joinpath("maps", f"{name}.toml")
    where = f"map {name}"
    try:
        return where, tomllib.loads(path.read_text("utf-8"))
    except OSError as error:
        raise SettingsError(f"{where} cannot be read ({error.strerror}): check its path") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise SettingsError(
            f"{where} is no TOML ({error}): see docs/how-to/map-modbus-registers.md"
        ) from None


def _check_keys(where: str, content: dict[str, Any]) -> None:
    for key, value in content.items():
        if key in GAUGES:
            _check_gauge(where, key, value)
        elif key not in _TEXTS and key not in _PARSERS:
            raise _unknown(where, key, value, [*_TEXTS, *GAUGES, *_PARSERS])


def _check_gauge(where: str, gauge: str, content: Any) -> None:
    if not isinstance(content, dict):
        raise SettingsError(f"{where}: {gauge} = {content!r} is no table: write [{gauge}] and its keys below")
    for key, value in content.items():
        if key not in _PARSERS:
            raise _unknown(where, f"{gauge}.{key}", value, list(_PARSERS))


def _unknown(where: str, key: str, value: Any, allowed: list[str]) -> SettingsError:
    return SettingsError(f"{where}: {key} = {value!r} is not known: allowed are {', '.join(allowed)}")


def _text(where: str, key: str, value: Any) -> str:
    if not isinstance(value, str) or "\n" in value:
        raise SettingsError(f"{where}: {key} = {value!r} is no line of text: put it into quotes, on one line")
    return value


def _values(where: str, content: dict[str, Any], given: Mapping[str, str], gauge: str) -> dict[str, _Value]:
    """What holds for a gauge: the file's, its own before the common, and on top what was given."""
    values = {key: _Value(value, f"{where}: {key}") for key, value in content.items() if key in _PARSERS}
    own = content.get(gauge, {}).items()
    values |= {key: _Value(value, f"{where}: {gauge}.{key}") for key, value in own}
    values |= {key: _Value(value, f"--set {key}") for key, value in given.items() if key in _PARSERS}
    for key, value in given.items():
        if key.startswith(f"{gauge}_"):
            values[key.removeprefix(f"{gauge}_")] = _Value(value, f"--set {key}")
    return values


def _channel(gauge: str, values: dict[str, _Value], where: str) -> Channel:
    read = dict(_read(values))
    for key in ("unit", "register"):
        if key not in read:
            raise SettingsError(
                f"{where}: {gauge}.{key} is missing: give it in the map, or --set {gauge}_{key}=NUMBER"
            )
    return Channel(
        unit=read["unit"],
        function=read.get("function", Function.READ_HOLDING),
        register=read["register"],
        kind=read.get("type", ValueType.INT32),
        order=read.get("order", ByteOrder.ABCD),
        scale=read.get("scale", 1.0),
        status=_status(read),
        zero_command=_zeroing(gauge, read, where),
    )


def _read(values: dict[str, _Value]) -> Iterator[tuple[str, Any]]:
    for key, given in values.items():
        reader = _PARSERS[key]
        try:
            yield key, reader.read(given.value)
        except (ValueError, TypeError, KeyError):
            raise SettingsError(f"{given.where} = {given.value!r} cannot be: give {reader.allowed}") from None


def _status(read: dict[str, Any]) -> Status | None:
    if "status_register" not in read:
        return None
    return Status(
        read["status_register"],
        read.get("overload_bits", ()),
        read.get("fault_bits", ()),
        read.get("sign_bit"),
    )


def _zeroing(gauge: str, read: dict[str, Any], where: str) -> ZeroCommand | None:
    if "zero_register" not in read:
        return None
    if "zero_value" not in read:
        raise SettingsError(
            f"{where}: {gauge}.zero_value is missing: give what zero_register takes as the command"
        )
    function = read.get("zero_function", Function.WRITE_SINGLE)
    return ZeroCommand(read["zero_register"], read["zero_value"], function)


@dataclass(frozen=True, slots=True)
class _Parser:
    """How a value is read, from TOML or from text, and what may be given."""

    read: Callable[[Any], Any]
    allowed: str


def _whole(low: int, high: int) -> _Parser:
    def read(value: Any) -> int:
        number = int(value, 0) if isinstance(value, str) else value
        if isinstance(number, bool) or not isinstance(number, int) or not low <= number <= high:
            raise ValueError
        return number

    return _Parser(read, f"a whole number from {low} to {high}")


def _function(*allowed: Function) -> _Parser:
    def read(value: Any) -> Function:
        function = Function(int(value))
        if function not in allowed:
            raise ValueError
        return function

    return _Parser(read, " or ".join(str(int(function)) for function in allowed))


def _scale(value: Any) -> float:
    number = float(value)
    if isinstance(value, bool) or not 0.0 < abs(number) < float("inf"):
        raise ValueError
    return number


def _bits(value: Any) -> tuple[int, ...]:
    parts = value.split(",") if isinstance(value, str) else value
    one = _whole(0, WORD_BITS - 1)
    return tuple(one.read(part) for part in parts if part != "")


_REGISTER = _whole(0, _LAST_REGISTER)
_BITS = _Parser(_bits, f"bits from 0 to {WORD_BITS - 1}, such as [2, 3] (--set: 2,3)")
_PARSERS = {
    "unit": _whole(1, MAX_UNIT),
    "function": _function(*READ_FUNCTIONS),
    "register": _REGISTER,
    "type": _Parser(ValueType, "one of " + ", ".join(ValueType)),
    "order": _Parser(ByteOrder, "one of " + ", ".join(ByteOrder)),
    "scale": _Parser(_scale, "a number that is not 0"),
    "status_register": _REGISTER,
    "overload_bits": _BITS,
    "fault_bits": _BITS,
    "sign_bit": _whole(0, WORD_BITS - 1),
    "zero_register": _REGISTER,
    "zero_value": _whole(0, 0xFFFF),
    "zero_function": _function(*WRITE_FUNCTIONS),
}
