"""The only reader and writer of settings files: where they are, what is wrong with them."""

import csv
import os
import tomllib
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import platformdirs

from config.schema import ConfigError, Gauges, PublishedRow, Stand

T = TypeVar("T", bound=msgspec.Struct)

_SHIPPED = Path(str(files("config")))


def config_directory() -> Path:
    """Folder of the settings in use.

    `SLIPSTAND_CONFIG` if set; `config/` when run from a checkout; else the user's configuration
    folder, in which a missing file falls back to the shipped one.
    """
    override = os.environ.get("SLIPSTAND_CONFIG")
    if override:
        return Path(override).expanduser().resolve()
    if is_checkout():
        return _SHIPPED
    return Path(platformdirs.user_config_dir("slipstand", appauthor=False))


def is_checkout() -> bool:
    """Tell whether this is a source checkout rather than an installation."""
    return (_SHIPPED.parent / "pyproject.toml").is_file()


def settings_file(name: str) -> Path:
    """Path of a settings file: the lab's own where there is one, else the shipped one."""
    own = config_directory() / name
    return own if own.is_file() else _SHIPPED / name


def load_stand(path: Path | str | None = None) -> Stand:
    """Read a stand file, by default the one in use. Raises ConfigError."""
    return _load(Path(path) if path else settings_file("stand.toml"), Stand)


def load_gauges(path: Path | str | None = None) -> Gauges:
    """Read a calibration file, by default the one in use. Raises ConfigError."""
    return _load(Path(path) if path else settings_file("gauges.toml"), Gauges)


@cache
def published_table() -> dict[str, PublishedRow]:
    """Table 1 of the paper by series code, in the paper's order."""
    return {row.series: row for row in load_published_rows(_SHIPPED / "table1.csv")}


def load_published_rows(path: Path) -> list[PublishedRow]:
    """Read a published table: a CSV file with the columns of the shipped `table1.csv`. Raises ConfigError."""
    rows = []
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            for line, row in enumerate(csv.DictReader(file), start=2):
                rows.append(_published_row(path, line, row))
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read ({error}). Give a readable UTF-8 CSV file") from None
    if not rows:
        raise ConfigError(f"{path}: holds no rows. Give a header and a row a series, as in Table 1")
    return rows


def published_row(series: str) -> PublishedRow:
    """Row of Table 1 for a series code. Raises ConfigError where the paper has none."""
    try:
        return published_table()[series]
    except KeyError:
        raise ConfigError(
            f"series {series!r} has no row in Table 1: choose one of {', '.join(published_table())}"
        ) from None


def _published_row(path: Path, line: int, row: dict[str | Any, str | Any]) -> PublishedRow:
    try:
        return msgspec.convert(row, PublishedRow, strict=False)
    except msgspec.ValidationError as error:
        raise ConfigError(
            f"{path}: line {line}: {_explain(str(error), row)}. The columns are those of Table 1: "
            f"{', '.join(PublishedRow.__struct_fields__)}"
        ) from None


def _load(path: Path, kind: type[T]) -> T:
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ConfigError(f"{path}: there is no such file. Give the path of a {_what(kind)} file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read ({error}). Give a readable UTF-8 text file") from None
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: is not valid TOML ({error}). Correct that line") from None
    try:
        return msgspec.convert(raw, kind)
    except msgspec.ValidationError as error:
        raise ConfigError(f"{path}: {_explain(str(error), raw)}") from None


def _what(kind: type) -> str:
    return "stand" if kind is Stand else "calibration"


def _explain(message: str, raw: object) -> str:
    """Turn "Expected `float`, got `str` - at `$.table.range_m`" into key, value, and what is allowed."""
    fault, _, place = message.partition(" - at `$")
    keys = [key for key in place.rstrip("`").replace("[...]", ".*").split(".") if key]
    value = raw
    for key in keys:
        value = value.get(key) if isinstance(value, dict) else None
    if not keys:
        return fault
    shown = f" = {value!r}" if isinstance(value, str | int | float | bool | list) else ""
    return f"{'.'.join(keys)}{shown}: {fault}"
