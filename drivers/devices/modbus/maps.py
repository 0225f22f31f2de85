"""Register maps: registers of the gauges, read from TOML and checked key by key."""

import contextlib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import msgspec

from drivers.devices.modbus.frames import (
    MAX_REGISTERS,
    MAX_UNIT,
    READ_FUNCTIONS,
    WRITE_FUNCTIONS,
    Function,
)
from drivers.devices.modbus.registers import WORD_BITS, ByteOrder, Channel, Framing, ValueType
from drivers.driver import GAUGES
from drivers.errors import SettingsError
from drivers.toml_files import load_toml, shipped_names
from messages.i18n import N_
from messages.message import Message, message

_TEXTS = ("base", "title", "source", "peer", "framing", "caution")
_SHIPPED = files("drivers.devices.modbus").joinpath("maps")


@dataclass(frozen=True, slots=True)
class RegisterMap:
    """A transmitter, or two on one bus."""

    name: str  # as given to `--set map=`
    title: str
    caution: str
    """Note for every run that is read by this map; "" for none."""
    channels: dict[str, Channel]  # of the gauges `table` and `relative`, or of one of them
    framing: Framing = Framing.RTU
    """That of the transmitter, unless the setting `framing` names another one."""


def shipped_maps() -> list[str]:
    """Names of the maps in the driver's folder."""
    return shipped_names(_SHIPPED)


def is_map_key(key: str) -> bool:
    """Whether a setting is one of a map."""
    return any(key.removeprefix(f"{gauge}_") in _ALLOWED for gauge in GAUGES)


def read_map(name: str, given: Mapping[str, str], gauges: tuple[str, ...] = GAUGES) -> RegisterMap:
    """Read a shipped map or a file, changed by given values.

    `name` is that of a shipped map, or a file that ends in `.toml`; `given` holds values by key: `register`
    for both gauges, `table_register` for one. Raises SettingsError, which names file, key, value and remedy.
    """
    where, content = _content(name)
    channels = {gauge: _channel(gauge, _given(where, content, given, gauge), where) for gauge in gauges}
    framing = content.get("framing", Framing.RTU)
    if framing not in tuple(Framing):
        raise _impossible(f"{where}: framing", framing, message("one of {names}", names=list(Framing)))
    title = content.get("title") or name
    return RegisterMap(name, title, content.get("caution", ""), channels, Framing(framing))


@dataclass(frozen=True, slots=True)
class MapOrigin:
    """What a map is of, and from."""

    title: str
    source: str  # document that its registers are from; "" for none
    peer: str
    """Program that is not ours and that it was tested against; "" for none."""


def read_origin(name: str) -> MapOrigin:
    """Origin of a shipped map, or of a file. Raises SettingsError."""
    content = _content(name)[1]
    return MapOrigin(content.get("title") or name, content.get("source", ""), content.get("peer", ""))


def _content(name: str) -> tuple[str, dict[str, Any]]:
    path: Any = Path(name).expanduser()
    if path.suffix != ".toml":
        if name not in shipped_maps():
            template = N_(
                "map {name!r} is not known: give one of {shipped}, or a file of your own that ends in .toml"
            )
            raise SettingsError(template, name=name, shipped=shipped_maps())
        path = _SHIPPED.joinpath(f"{name}.toml")
    where = f"map {name}"
    content = load_toml(path, where, "docs/how-to/map-modbus-registers.md")
    _check_keys(where, content, [*_TEXTS, *GAUGES, *_ALLOWED])
    base = content.pop("base", None)
    if base is not None and base not in shipped_maps():
        raise _impossible(f"{where}: base", base, message("one of {names}", names=shipped_maps()))
    return where, (_content(base)[1] if base else {}) | content


def _check_keys(where: str, content: dict[str, Any], allowed: list[str], prefix: str = "") -> None:
    for key, value in content.items():
        shown = repr(value)
        if key not in allowed:
            template = N_("{where}: {key} = {value} is not known: allowed are {allowed}")
            raise SettingsError(template, where=where, key=prefix + key, value=shown, allowed=allowed)
        if key in _TEXTS and (not isinstance(value, str) or "\n" in value):
            template = N_("{where}: {key} = {value} is no line of text: put it into quotes, on one line")
            raise SettingsError(template, where=where, key=key, value=shown)
        if key in GAUGES:
            if not isinstance(value, dict):
                template = N_("{where}: {gauge} = {content} is no table: write [{gauge}] and its keys below")
                raise SettingsError(template, where=where, gauge=key, content=shown)
            _check_keys(where, value, list(_ALLOWED), f"{key}.")


def _given(
    where: str, content: dict[str, Any], given: Mapping[str, str], gauge: str
) -> dict[str, tuple[Any, str]]:
    """Value of each key of a gauge, and its place: in the map for both gauges or for one, or in `--set`."""
    in_map = {key: (value, f"{where}: {key}") for key, value in content.items() if key in _ALLOWED}
    in_map |= {key: (value, f"{where}: {gauge}.{key}") for key, value in content.get(gauge, {}).items()}
    in_map |= {key: (value, f"--set {key}") for key, value in given.items() if key in _ALLOWED}
    own = {key: value for key, value in given.items() if key.startswith(f"{gauge}_")}
    return in_map | {key.removeprefix(f"{gauge}_"): (value, f"--set {key}") for key, value in own.items()}


def _channel(gauge: str, given: dict[str, tuple[Any, str]], where: str) -> Channel:
    read: dict[str, Any] = {"function": Function.READ_HOLDING}
    read |= {key: _parse(key, value, place) for key, (value, place) in given.items()}
    for key in ("unit", "register"):
        if key not in read:
            template = N_(
                "{where}: {gauge}.{key} is missing: give it in the map, or --set {gauge}_{key}=NUMBER"
            )
            raise SettingsError(template, where=where, gauge=gauge, key=key)
    if "zero_register" in read and "zero_value" not in read:
        template = N_("{where}: {gauge}.zero_value is missing: give what zero_register takes as the command")
        raise SettingsError(template, where=where, gauge=gauge)
    if "status_register" not in read:
        read = {key: value for key, value in read.items() if not key.endswith(("_bits", "_bit"))}
    return msgspec.convert(read, Channel)


def _parse(key: str, value: Any, place: str) -> Any:
    parsed = value
    if isinstance(value, str) and key.endswith("_bits"):
        parsed = [part for part in value.split(",") if part]
    elif isinstance(value, str):
        with contextlib.suppress(ValueError):
            parsed = int(value, 0)
    try:
        parsed = msgspec.convert(parsed, _TYPES[key], strict=False)
        is_possible = parsed in _FUNCTIONS.get(key, (parsed,))
        if key == "scale":
            is_possible = 0 < abs(parsed) < math.inf
    except msgspec.ValidationError:
        is_possible = False
    if is_possible:
        return parsed
    raise _impossible(place, value, _ALLOWED[key])


def _impossible(where: str, value: object, allowed: Message) -> SettingsError:
    template = N_("{where} = {value} cannot be: give {allowed}")
    return SettingsError(template, where=where, value=repr(value), allowed=allowed)


def _whole(low: int, high: int) -> Message:
    return message("a whole number from {low} to {high}", low=low, high=high)


_TYPES = {one.encode_name: one.type for one in msgspec.structs.fields(Channel)}
_FUNCTIONS = {"function": READ_FUNCTIONS, "zero_function": WRITE_FUNCTIONS}
_BITS = message("bits from 0 to {last}, such as [2, 3] (--set: 2,3)", last=WORD_BITS - 1)
_WORD = _whole(0, 0xFFFF)
_ALLOWED = {
    "unit": message("{usual}, with framing tcp also 0 and 255", usual=_whole(1, MAX_UNIT)),
    "function": message("{first} or {second}", first=3, second=4),
    "register": _WORD,
    "type": message("one of {names}", names=list(ValueType)),
    "order": message("one of {names}", names=list(ByteOrder)),
    "scale": message("a number that is not 0"),
    "status_register": _WORD,
    "overload_bits": _BITS,
    "fault_bits": _BITS,
    "max_hole": _whole(0, MAX_REGISTERS),
    "sign_bit": _whole(0, WORD_BITS - 1),
    "zero_register": _WORD,
    "zero_value": _WORD,
    "zero_function": message("{first} or {second}", first=6, second=16),
}
"""Allowed values in messages, by the keys of a map."""
MAP_KEYS = tuple(_ALLOWED)
"""Keys of a map that `--set` may give for both gauges, or with `table_` or `relative_` for one."""
