"""Register maps: registers of the gauges, read from TOML and checked key by key."""

import contextlib
import math
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import msgspec

from drivers.devices.modbus.frames import MAX_UNIT, READ_FUNCTIONS, WRITE_FUNCTIONS, Function
from drivers.devices.modbus.registers import WORD_BITS, ByteOrder, Channel, ValueType
from drivers.driver import GAUGES
from drivers.errors import SettingsError
from messages.message import Message, message

_TEXTS = ("title", "source", "caution")
_PACKAGE = "drivers.devices.modbus"


@dataclass(frozen=True, slots=True)
class RegisterMap:
    """A transmitter, or two on one bus."""

    name: str
    """As given to `--set map=`."""
    title: str
    caution: str
    """Note for every run that is read by this map; "" for none."""
    channels: dict[str, Channel]
    """Of the gauges `table` and `relative`, or of one of them."""


def shipped_maps() -> list[str]:
    """Names of the maps in the driver's folder."""
    folder = files(_PACKAGE).joinpath("maps")
    return sorted(entry.name[: -len(".toml")] for entry in folder.iterdir() if entry.name.endswith(".toml"))


def map_keys() -> list[str]:
    """Keys of a map that `--set` may give for both gauges, or with `table_` or `relative_` for one."""
    return list(_ALLOWED)


def is_map_key(key: str) -> bool:
    """Whether a setting is one of a map."""
    return any(key.removeprefix(f"{gauge}_") in _ALLOWED for gauge in GAUGES)


def read_map(name: str, given: Mapping[str, str], gauges: tuple[str, ...] = GAUGES) -> RegisterMap:
    """Read a shipped map or a file, changed by given values.

    `name` is that of a shipped map, or a file that ends in `.toml`; `given` holds values by key: `register`
    for both gauges, `table_register` for one. Raises SettingsError, which names file, key, value and remedy.
    """
    where, content = _content(name)
    _check_keys(where, content)
    texts = {key: _text(where, key, content.get(key, "")) for key in _TEXTS}
    channels = {gauge: _channel(gauge, _given(where, content, given, gauge), where) for gauge in gauges}
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
        elif key not in _TEXTS and key not in _ALLOWED:
            raise _unknown(where, key, value, [*_TEXTS, *GAUGES, *_ALLOWED])


def _check_gauge(where: str, gauge: str, content: Any) -> None:
    if not isinstance(content, dict):
        raise SettingsError(
            "{where}: {gauge} = {content} is no table: write [{gauge}] and its keys below",
            where=where,
            gauge=gauge,
            content=repr(content),
        )
    for key, value in content.items():
        if key not in _ALLOWED:
            raise _unknown(where, f"{gauge}.{key}", value, list(_ALLOWED))


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


def _given(
    where: str, content: dict[str, Any], given: Mapping[str, str], gauge: str
) -> Iterator[tuple[str, Any, str]]:
    """Key, value and place of what applies to a gauge, later ones before earlier ones.

    Values of the map for both gauges come first, then its own, then those of `--set`.
    """
    for key, value in content.items():
        if key in _ALLOWED:
            yield key, value, f"{where}: {key}"
    for key, value in content.get(gauge, {}).items():
        yield key, value, f"{where}: {gauge}.{key}"
    for key, value in given.items():
        if key in _ALLOWED:
            yield key, value, f"--set {key}"
    for key, value in given.items():
        if key.startswith(f"{gauge}_"):
            yield key.removeprefix(f"{gauge}_"), value, f"--set {key}"


def _channel(gauge: str, given: Iterable[tuple[str, Any, str]], where: str) -> Channel:
    latest = {key: (value, place) for key, value, place in given}
    read: dict[str, Any] = {"function": Function.READ_HOLDING}
    read |= {key: _parse(key, value, place) for key, (value, place) in latest.items()}
    for key in ("unit", "register"):
        if key not in read:
            raise SettingsError(
                "{where}: {gauge}.{key} is missing: give it in the map, or --set {gauge}_{key}=NUMBER",
                where=where,
                gauge=gauge,
                key=key,
            )
    if "zero_register" in read and "zero_value" not in read:
        raise SettingsError(
            "{where}: {gauge}.zero_value is missing: give what zero_register takes as the command",
            where=where,
            gauge=gauge,
        )
    if "status_register" not in read:
        read = {key: value for key, value in read.items() if not key.endswith(("_bits", "_bit"))}
    return msgspec.convert(read, Channel)


def _parse(key: str, value: Any, place: str) -> Any:
    """Value as its field takes it, from TOML or from the text of `--set`: `0x10`, `2,3`."""
    parsed = value
    if isinstance(value, str) and key.endswith("_bits"):
        parsed = [part for part in value.split(",") if part]
    elif isinstance(value, str):
        with contextlib.suppress(ValueError):
            parsed = int(value, 0)
    try:
        parsed = msgspec.convert(parsed, _TYPES[key], strict=False)
        is_possible = (
            parsed in _FUNCTIONS.get(key, (parsed,)) if key != "scale" else 0 < abs(parsed) < math.inf
        )
    except msgspec.ValidationError:
        is_possible = False
    if not is_possible:
        raise SettingsError(
            "{where} = {value} cannot be: give {allowed}",
            where=place,
            value=repr(value),
            allowed=_ALLOWED[key],
        )
    return parsed


def _whole(low: int, high: int) -> Message:
    return message("a whole number from {low} to {high}", low=low, high=high)


_TYPES = {one.encode_name: one.type for one in msgspec.structs.fields(Channel)}
_FUNCTIONS = {"function": READ_FUNCTIONS, "zero_function": WRITE_FUNCTIONS}
_BITS = message("bits from 0 to {last}, such as [2, 3] (--set: 2,3)", last=WORD_BITS - 1)
_ALLOWED = {
    "unit": _whole(1, MAX_UNIT),
    "function": message("{first} or {second}", first=3, second=4),
    "register": _whole(0, 0xFFFF),
    "type": message("one of {names}", names=list(ValueType)),
    "order": message("one of {names}", names=list(ByteOrder)),
    "scale": message("a number that is not 0"),
    "status_register": _whole(0, 0xFFFF),
    "overload_bits": _BITS,
    "fault_bits": _BITS,
    "sign_bit": _whole(0, WORD_BITS - 1),
    "zero_register": _whole(0, 0xFFFF),
    "zero_value": _whole(0, 0xFFFF),
    "zero_function": message("{first} or {second}", first=6, second=16),
}
"""Allowed values in messages, by the keys of a map."""
