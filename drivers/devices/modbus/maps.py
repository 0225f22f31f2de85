"""Register maps: registers of the gauges, read from TOML and checked key by key."""

import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from drivers.devices.modbus.frames import MAX_UNIT, READ_FUNCTIONS, WRITE_FUNCTIONS, Function
from drivers.devices.modbus.registers import WORD_BITS, ByteOrder, Channel, Status, ValueType, ZeroCommand
from drivers.driver import GAUGES
from drivers.errors import SettingsError
from messages.message import Message, message

_LAST_REGISTER = 0xFFFF
_TEXTS = ("title", "source", "caution")
_PACKAGE = "drivers.devices.modbus"


@dataclass(frozen=True, slots=True)
class RegisterMap:
    """A transmitter, or two on one bus."""

    name: str
    """As given to `--set map=`."""
    title: str
    """For people."""
    caution: str
    """Note for every run that is read by this map; "" for none."""
    channels: dict[str, Channel]
    """Of the gauges `table` and `relative`, or of one of them."""


@dataclass(frozen=True, slots=True)
class _Value:
    """A given value, and where it was given."""

    value: Any
    where: str


def shipped_maps() -> list[str]:
    """Names of the maps in the driver's folder."""
    folder = files(_PACKAGE).joinpath("maps")
    return sorted(entry.name[: -len(".toml")] for entry in folder.iterdir() if entry.name.endswith(".toml"))


def map_keys() -> list[str]:
    """Keys of a map that `--set` may give for both gauges, or with `table_` or `relative_` for one."""
    return list(_PARSERS)


def is_map_key(key: str) -> bool:
    """Whether a setting is one of a map."""
    return any(key.removeprefix(f"{gauge}_") in _PARSERS for gauge in GAUGES)


def read_map(name: str, given: Mapping[str, str], gauges: tuple[str, ...] = GAUGES) -> RegisterMap:
    """Read a shipped map or a file, changed by given values.

    `name` is that of a shipped map, or a file that ends in `.toml`; `given` holds values by key: `register`
    for both gauges, `table_register` for one. Raises SettingsError, which names file, key, value and remedy.
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
                "map {name!r} is not known: give one of {shipped}, or a file of your own that ends in .toml",
                name=name,
                shipped=shipped_maps(),
            )
        path = files(_PACKAGE).joinpath("maps", f"{name}.toml")
    where = f"map {name}"
    try:
        return where, tomllib.loads(path.read_text("utf-8"))
    except OSError as error:
        raise SettingsError(
            "{where} cannot be read ({fault}): check its path", where=where, fault=error.strerror
        ) from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise SettingsError(
            "{where} is no TOML ({fault}): see docs/how-to/map-modbus-registers.md", where=where, fault=error
        ) from None


def _check_keys(where: str, content: dict[str, Any]) -> None:
    for key, value in content.items():
        if key in GAUGES:
            _check_gauge(where, key, value)
        elif key not in _TEXTS and key not in _PARSERS:
            raise _unknown(where, key, value, [*_TEXTS, *GAUGES, *_PARSERS])


def _check_gauge(where: str, gauge: str, content: Any) -> None:
    if not isinstance(content, dict):
        raise SettingsError(
            "{where}: {gauge} = {content} is no table: write [{gauge}] and its keys below",
            where=where,
            gauge=gauge,
            content=repr(content),
        )
    for key, value in content.items():
        if key not in _PARSERS:
            raise _unknown(where, f"{gauge}.{key}", value, list(_PARSERS))


def _unknown(where: str, key: str, value: Any, allowed: list[str]) -> SettingsError:
    return SettingsError(
        "{where}: {key} = {value} is not known: allowed are {allowed}",
        where=where,
        key=key,
        value=repr(value),
        allowed=allowed,
    )


def _text(where: str, key: str, value: Any) -> str:
    if not isinstance(value, str) or "\n" in value:
        raise SettingsError(
            "{where}: {key} = {value} is no line of text: put it into quotes, on one line",
            where=where,
            key=key,
            value=repr(value),
        )
    return value


def _values(where: str, content: dict[str, Any], given: Mapping[str, str], gauge: str) -> dict[str, _Value]:
    """Values for a gauge: those of the file, its own before the common ones, and then the given ones."""
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
                "{where}: {gauge}.{key} is missing: give it in the map, or --set {gauge}_{key}=NUMBER",
                where=where,
                gauge=gauge,
                key=key,
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
        parser = _PARSERS[key]
        try:
            yield key, parser.read(given.value)
        except (ValueError, TypeError, KeyError):
            raise SettingsError(
                "{where} = {value} cannot be: give {allowed}",
                where=given.where,
                value=repr(given.value),
                allowed=parser.allowed,
            ) from None


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
            "{where}: {gauge}.zero_value is missing: give what zero_register takes as the command",
            where=where,
            gauge=gauge,
        )
    function = read.get("zero_function", Function.WRITE_SINGLE)
    return ZeroCommand(read["zero_register"], read["zero_value"], function)


@dataclass(frozen=True, slots=True)
class _Parser:
    """How a value is parsed, from TOML or text, and what is allowed."""

    read: Callable[[Any], Any]
    allowed: Message


def _whole(low: int, high: int) -> _Parser:
    def read(value: Any) -> int:
        number = int(value, 0) if isinstance(value, str) else value
        if isinstance(number, bool) or not isinstance(number, int) or not low <= number <= high:
            raise ValueError
        return number

    return _Parser(read, message("a whole number from {low} to {high}", low=low, high=high))


def _function(*allowed: Function) -> _Parser:
    def read(value: Any) -> Function:
        function = Function(int(value))
        if function not in allowed:
            raise ValueError
        return function

    first, second = allowed
    return _Parser(read, message("{first} or {second}", first=int(first), second=int(second)))


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
_BITS = _Parser(_bits, message("bits from 0 to {last}, such as [2, 3] (--set: 2,3)", last=WORD_BITS - 1))
_PARSERS = {
    "unit": _whole(1, MAX_UNIT),
    "function": _function(*READ_FUNCTIONS),
    "register": _REGISTER,
    "type": _Parser(ValueType, message("one of {names}", names=list(ValueType))),
    "order": _Parser(ByteOrder, message("one of {names}", names=list(ByteOrder))),
    "scale": _Parser(_scale, message("a number that is not 0")),
    "status_register": _REGISTER,
    "overload_bits": _BITS,
    "fault_bits": _BITS,
    "sign_bit": _whole(0, WORD_BITS - 1),
    "zero_register": _REGISTER,
    "zero_value": _whole(0, 0xFFFF),
    "zero_function": _function(*WRITE_FUNCTIONS),
}
