"""The only reader and writer of settings files: where they are, what is wrong with them."""

import contextlib
import csv
import datetime
import itertools
import os
import tomllib
from collections.abc import Collection, Iterator
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import platformdirs

from config import schema
from config.durable_files import (
    FileInUseError,
    file_in_use,
    give_new_name,
    make_folders,
    replace_file,
    sync_descriptor,
    sync_folder,
)
from config.schema import ConfigError, Gauge, GaugeCheck, GaugeChecks, Gauges, PublishedRow, Settings, Stand
from messages.i18n import N_

T = TypeVar("T", bound=msgspec.Struct)

_CHECKS_TITLE = "# Checks of the gauges, added by `slipstand calibrate check`.\n\n"
_SHIPPED = Path(__file__).parent


def config_directory() -> Path:
    """Folder of the settings in use: `SLIPSTAND_CONFIG`, else `config/` of a checkout, else the user's."""
    override = os.environ.get("SLIPSTAND_CONFIG")
    if override:
        return Path(override).expanduser().resolve()
    if is_checkout():
        return _SHIPPED
    return Path(platformdirs.user_config_dir("slipstand", appauthor=False))


def is_checkout() -> bool:
    """Whether this is a source checkout rather than an installation."""
    return (_SHIPPED.parent / "pyproject.toml").is_file()


def settings_file(name: str) -> Path:
    """Path of a settings file: the lab's own where there is one, else the shipped one."""
    own = config_directory() / name
    return own if own.is_file() else _SHIPPED / name


def load_stand(path: Path | str | None = None) -> Stand:
    """Read a stand file, by default the one in use. Raises ConfigError."""
    path = Path(path) if path else settings_file("stand.toml")
    stand = _load(path, Stand)
    try:
        stand.check_codes()
    except ConfigError as error:
        raise ConfigError("{path}: {fault}", path=path, fault=error.message) from None
    return stand


def parse_stand(values: dict[str, Any]) -> Stand:
    """Make a stand of values as a stand file holds them, checked alike. Raises ConfigError."""
    try:
        stand = msgspec.convert(values, Stand)
    except msgspec.ValidationError as error:
        raise ConfigError("{fault}", fault=_explain(str(error), values)) from None
    stand.check_codes()
    return stand


def save_stand(stand: Stand) -> Path:
    """Write the stand file of the laboratory, whose path is returned; its comments stay. Raises ConfigError.

    Without one of its own the shipped file is taken over.
    """
    import tomlkit  # only needed to write

    source, target = settings_file("stand.toml"), config_directory() / "stand.toml"
    with _writing(target):
        load_stand(source)  # a file that cannot be read is not written over
        document = tomlkit.parse(source.read_text(encoding="utf-8"))
        _merge(document, _stated(stand, document))
        make_folders(target.parent)
        _replace(target, tomlkit.dumps(document))
    return target


def load_gauges(path: Path | str | None = None) -> Gauges:
    """Read a calibration file, by default the one in use. Raises ConfigError."""
    return _load(Path(path) if path else settings_file("gauges.toml"), Gauges)


def save_calibration(
    gauges: dict[str, Gauge], base: Path, day: datetime.date, path: Path | None = None
) -> Path:
    """Write a new calibration file: `base` with new values of the gauges named, its comments kept.

    Without a `path` it gets a dated name in the folder of settings, `gauges-2026-01-12.toml`. Returns the
    path; no file is ever overwritten. Raises ConfigError.
    """
    import tomlkit  # only needed to write

    load_gauges(base)
    document = tomlkit.parse(base.read_text(encoding="utf-8"))
    for name, gauge in gauges.items():
        _write_gauge(document[name], gauge)
    text = tomlkit.dumps(document)
    if path is None:
        return _write_dated(f"gauges-{day.isoformat()}", text)
    with _writing(path):
        try:
            _write_new(path, text)
        except FileExistsError:
            template = N_("{path} exists already and is not overwritten. Choose another name")
            raise ConfigError(template, path=path) from None
    return path


def _stated(stand: Stand, before: Collection[str]) -> dict[str, Any]:
    """Values for a stand file; a default or an empty table that did not stand there before needs no line."""
    values = msgspec.to_builtins(stand)
    defaults = {field.name: field.default for field in msgspec.structs.fields(Stand)}
    return {
        name: value for name, value in values.items() if name in before or value not in (defaults[name], {})
    }


def _merge(table: Any, values: dict[str, Any]) -> None:
    """Write values into a table of a TOML document; keys without a value go, and comments stay."""
    import tomlkit  # only needed to write

    for key in [key for key in table if key not in values]:
        del table[key]
    for key, value in values.items():
        if isinstance(value, dict) and key in table:
            _merge(table[key], value)
        elif isinstance(value, dict):
            made = tomlkit.inline_table()
            made.update(value)
            table[key] = made
        elif table.get(key) != value:
            table[key] = value


def _write_gauge(section: Any, gauge: Gauge) -> None:
    """Give a section the values of a gauge. A comment beside a value goes with it, others stay."""
    below = []  # comments at the end of a section are about the next one
    while section.value.body and section.value.body[-1][0] is None:
        below.append(section.value.body.pop())
    before = section.unwrap()
    for field in msgspec.structs.fields(Gauge):
        name, value = field.name, getattr(gauge, field.name)
        if value is None or (value == field.default and (name not in before or value == "")):
            section.pop(name, None)  # a default needs no line
        elif name not in before or before[name] != value:
            section[name] = _toml_value(value)
            trivia = section.value.item(name).trivia
            trivia.comment_ws = trivia.comment = ""
    section.value.body.extend(reversed(below))


def _toml_value(value: Any) -> Any:
    if isinstance(value, schema.Filter):
        import tomlkit  # only needed to write

        table = tomlkit.inline_table()
        table.update({name: part for name, part in msgspec.structs.asdict(value).items() if part is not None})
        return table
    return list(value) if isinstance(value, tuple) else value


def activate_calibration(path: Path, day: datetime.date) -> Path | None:
    """Make a calibration file the one that runs take by default.

    The one in use until then stays under a dated name, `gauges-until-2026-01-12.toml`, which is returned;
    None where there was none. Raises ConfigError.
    """
    load_gauges(path)
    target, kept = config_directory() / "gauges.toml", None
    with _writing(target):
        text = path.read_text(encoding="utf-8")
        if target.is_file():
            kept = _write_dated(f"gauges-until-{day.isoformat()}", target.read_text(encoding="utf-8"))
        _replace(target, text)
    return kept


def load_checks(path: Path | None = None) -> GaugeChecks:
    """Read the history of gauge checks, by default of the lab; empty without a file. Raises ConfigError."""
    return _load_or_default(path or checks_path(), GaugeChecks)


def append_check(check: GaugeCheck) -> Path:
    """Append a check to the history, whose path is returned; nothing in it changes. Raises ConfigError."""
    import tomlkit  # only needed to write

    path = checks_path()
    load_checks(path)  # nothing is added to a file that cannot be read
    entry = {name: value for name, value in msgspec.structs.asdict(check).items() if value not in ("", ())}
    entry = {name: list(value) if isinstance(value, tuple) else value for name, value in entry.items()}
    with _writing(path):
        make_folders(path.parent)
        before = f"{path.read_text(encoding='utf-8')}\n" if path.exists() else _CHECKS_TITLE
        _replace(path, f"{before}[[check]]\n{tomlkit.dumps(entry)}")
    return path


def checks_path() -> Path:
    """Where checks of gauges are kept."""
    return config_directory() / "gauge-checks.toml"


def settings_path() -> Path:
    """Where a person's settings are kept."""
    return config_directory() / "settings.toml"


def load_settings() -> Settings:
    """Read the person's settings; the defaults where there are none yet. Raises ConfigError."""
    return _load_or_default(settings_path(), Settings)


def save_settings(settings: Settings, day: datetime.date) -> Path | None:
    """Keep a person's settings, the comments of their file too.

    A file that cannot be read is not overwritten: it stays as `settings-unreadable-2026-01-12.toml`, which
    is returned; else None. Raises ConfigError.
    """
    return _save(settings_path(), msgspec.structs.asdict(settings), Settings, day)


def load_window_layout() -> schema.WindowLayout:
    """Read how the window was left; the defaults where it never was. Raises ConfigError."""
    return _load_or_default(config_directory() / "window.toml", schema.WindowLayout)


def save_window_layout(place: schema.WindowLayout, day: datetime.date) -> Path | None:
    """Keep how the window is left, as `save_settings` keeps settings. Raises ConfigError."""
    values = msgspec.structs.asdict(place)
    for key in ("widths", "sorted_by", "columns"):
        values[key] = {name: list(row) for name, row in values[key].items()}
    return _save(config_directory() / "window.toml", values, schema.WindowLayout, day)


def load_recent() -> schema.RecentUse:
    """Read what was used last; nothing where nothing was. Raises ConfigError."""
    return _load_or_default(config_directory() / "recent.toml", schema.RecentUse)


def save_recent(recent: schema.RecentUse, day: datetime.date) -> Path | None:
    """Keep what was used last, as `save_settings` keeps settings. Raises ConfigError."""
    values = {name: value for name, value in msgspec.to_builtins(recent).items() if value is not None}
    return _save(config_directory() / "recent.toml", values, schema.RecentUse, day)


def _save(path: Path, values: dict[str, Any], kind: type[T], day: datetime.date) -> Path | None:
    """Write values into a file that may be there already; one that cannot be read is put aside first."""
    import tomlkit  # only needed to write

    aside, document = None, tomlkit.document()
    with _writing(path):
        if path.exists():
            try:
                _load(path, kind)
                document = tomlkit.parse(path.read_text(encoding="utf-8"))
            except ConfigError:
                aside = _free_name(f"{path.stem}-unreadable-{day.isoformat()}")
                replace_file(path, aside)
        document.update(values)
        make_folders(path.parent)
        _replace(path, tomlkit.dumps(document))
    return aside


def _write_dated(stem: str, text: str) -> Path:
    with _writing(config_directory()):
        make_folders(config_directory())
        while True:
            path = _free_name(stem)
            with contextlib.suppress(FileExistsError):  # another process took it just now
                _write_new(path, text)
                return path


def _free_name(stem: str) -> Path:
    """Path in the folder of settings that is not taken: `stem.toml`, `stem-2.toml`, ..."""
    names = (f"{stem}{'' if number == 1 else f'-{number}'}.toml" for number in itertools.count(1))
    return next(path for name in names if not (path := config_directory() / name).exists())


def _replace(path: Path, text: str) -> None:
    beside = path.with_suffix(".toml.new")
    _write(beside, text)
    replace_file(beside, path)
    sync_folder(path.parent)


def _write_new(path: Path, text: str) -> None:
    """Write a file that has its name once it is on disk. Raises FileExistsError, OSError."""
    if path.exists():
        raise FileExistsError(str(path))
    beside = path.with_name(f"{path.name}.{os.getpid()}.new")
    _write(beside, text)
    try:
        give_new_name(beside, path)
    finally:
        beside.unlink(missing_ok=True)
    sync_folder(path.parent)


def _write(path: Path, text: str) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(text)
        file.flush()
        sync_descriptor(file.fileno())


@contextlib.contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        yield
    except FileInUseError:
        raise ConfigError(file_in_use(path).message) from None
    except OSError as error:
        template = N_("{path}: cannot be written ({fault}). Check the folder, its rights and its disk")
        raise ConfigError(template, path=path, fault=error.strerror or error) from None


@cache
def published_table() -> dict[str, PublishedRow]:
    """Table 1 of the paper by series code, in the paper's order."""
    return {row.series: row for row in load_published_rows(_SHIPPED / "table1.csv")}


def load_published_rows(path: Path) -> list[PublishedRow]:
    """Read a published table: a CSV file with the columns of the shipped `table1.csv`. Raises ConfigError."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            texts = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError) as error:
        template = N_("{path}: cannot be read ({fault}). Give a readable UTF-8 CSV file")
        raise ConfigError(template, path=path, fault=error) from None
    if not texts:
        raise ConfigError("{path}: holds no rows. Give a header and a row a series, as in Table 1", path=path)
    rows = []
    for line, row in enumerate(texts, start=2):
        try:
            rows.append(msgspec.convert(row, PublishedRow, strict=False))
        except msgspec.ValidationError as error:
            template = N_("{path}: line {line}: {fault}. The columns are those of Table 1: {columns}")
            fault, columns = _explain(str(error), row), list(PublishedRow.__struct_fields__)
            raise ConfigError(template, path=path, line=line, fault=fault, columns=columns) from None
    return rows


def published_row(series: str) -> PublishedRow:
    """Row of Table 1 for a series code. Raises ConfigError where the paper has none."""
    try:
        return published_table()[series]
    except KeyError:
        template = N_("series {series!r} has no row in Table 1: choose one of {series_of_table}")
        raise ConfigError(template, series=series, series_of_table=list(published_table())) from None


def _load_or_default(path: Path, kind: type[T]) -> T:
    return _load(path, kind) if path.exists() else kind()


def _load(path: Path, kind: type[T]) -> T:
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        template = N_("{path}: there is no such file. Give the path of a {kind} file")
        raise ConfigError(template, path=path, kind="stand" if kind is Stand else "calibration") from None
    except (OSError, UnicodeDecodeError) as error:
        template = N_("{path}: cannot be read ({fault}). Give a readable UTF-8 text file")
        raise ConfigError(template, path=path, fault=error) from None
    except tomllib.TOMLDecodeError as error:
        template = N_("{path}: is not valid TOML ({fault}). Correct that line")
        raise ConfigError(template, path=path, fault=error) from None
    try:
        return msgspec.convert(raw, kind)
    except msgspec.ValidationError as error:
        raise ConfigError("{path}: {fault}", path=path, fault=_explain(str(error), raw)) from None


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
