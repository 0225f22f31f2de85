"""Presets: settings of known devices, read from TOML."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from importlib.resources import files
from pathlib import Path
from typing import Any

from drivers.errors import SettingsError
from drivers.toml_files import load_toml, shipped_names
from messages.i18n import N_

COLUMNS, OPENSCALE = "columns", "openscale"
"""Formats that are no preset."""
_SHIPPED = files("drivers.devices.csv_lines").joinpath("presets")
_TEXTS = ("title", "source", "peer", "caution")
_ABOUT = (*_TEXTS, "baud", "identity")


@dataclass(frozen=True, slots=True)
class PresetIdentity:
    """How a device tells who it is."""

    query: str  # with escapes, as `poll`
    pattern: str  # regular expression of the answer, whose first group is shown
    answer: str
    """Of the simulated device, with escapes."""


@dataclass(frozen=True, slots=True)
class Preset:
    """A device that sends lines."""

    title: str
    source: str  # document that its settings are from
    peer: str  # program that is not ours and that it was tested against; "" for none
    caution: str  # note for every run that is read by it; "" for none
    baud: int
    settings: dict[str, str]
    identity: PresetIdentity | None = None


def shipped_presets() -> list[str]:
    """Names of the presets in the driver's folder."""
    return shipped_names(_SHIPPED)


def read_preset(name: str) -> Preset:
    """Read a shipped preset, or a file that ends in `.toml`. Raises SettingsError."""
    path: Any = Path(name).expanduser()
    if path.suffix != ".toml":
        if name not in shipped_presets():
            known = [COLUMNS, OPENSCALE, *shipped_presets()]
            template = N_(
                "format {name!r} is not known: give one of {known}, or a file of your own that ends in .toml"
            )
            raise SettingsError(template, name=name, known=known)
        path = _SHIPPED.joinpath(f"{name}.toml")
    content = load_toml(path, f"format {name}", "docs/how-to/read-lines.md")
    settings = {key: _text(value) for key, value in content.items() if key not in _ABOUT}
    baud = content.get("baud", 0)
    if not isinstance(baud, int):
        raise SettingsError("format {name}: baud = {baud!r} is no whole number", name=name, baud=baud)
    texts = {key: str(content.get(key, "")) for key in _TEXTS}
    return Preset(
        **texts | {"title": texts["title"] or name},
        baud=baud,
        settings=settings,
        identity=_identity(name, content.get("identity")),
    )


def _identity(name: str, given: Any) -> PresetIdentity | None:
    if given is None:
        return None
    wanted = [field.name for field in fields(PresetIdentity)]
    if not isinstance(given, dict) or set(given) != set(wanted):
        template = N_("format {name}: [identity] is incomplete: give {keys}, or leave it out")
        raise SettingsError(template, name=name, keys=wanted)
    return PresetIdentity(**{key: str(value) for key, value in given.items()})


def with_preset(given: Mapping[str, str]) -> tuple[dict[str, str], Preset | None]:
    """Settings, with those of the preset that their `format` names below them. Raises SettingsError."""
    name = given.get("format", COLUMNS)
    if name in (COLUMNS, OPENSCALE):
        return dict(given), None
    preset = read_preset(name)
    return preset.settings | {key: value for key, value in given.items() if key != "format"}, preset


def _text(value: Any) -> str:
    return ",".join(map(str, value)) if isinstance(value, list) else str(value)
