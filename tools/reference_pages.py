"""Write the reference of options and of settings files: `python -m tools.reference_pages`.

Options are read from the command line itself, settings from `config.schema`. A test compares both pages.
"""

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
import typer
from typer.core import TyperGroup

from app.cli.commands import app
from config import schema

REFERENCE = Path(__file__).resolve().parent.parent / "docs" / "reference"
OPTIONS, CONFIGURATION = REFERENCE / "options.md", REFERENCE / "configuration.md"
_OPTIONS_INTRODUCTION = """# Options of every command

This page is written from the command line itself by `python -m tools.reference_pages`.
[Commands](commands.md) says what the commands do.
"""
_CONFIGURATION_INTRODUCTION = """# Settings files

This page is written from `config/schema.py` by `python -m tools.reference_pages`. All files are TOML. An
unknown key, a value of another type and a value outside its limits are refused in one line.
`slipstand doctor` names the folder in use.
"""
_FILES = (
    ("stand.toml", "the stand and the series it runs", schema.Stand),
    ("gauges.toml", "a calibration file: both gauges and their device", schema.Gauges),
    ("settings.toml", "what a person has chosen", schema.Settings),
)


def options_page() -> str:
    """Text of the page of options."""
    lines = [_OPTIONS_INTRODUCTION]
    for name, command in _commands(typer.main.get_command(app), "slipstand"):
        context = typer.Context(command)
        records = [one.get_help_record(context) for one in command.params]
        rows = [(f"`{names}`".replace("|", r"\|"), _text(about)) for names, about in filter(None, records)]
        about = " ".join((command.help or "").split())
        lines += [f"## `{name}`\n", f"{_text(about)}\n" if about else ""]
        lines += _table(("option", "meaning"), rows)
    return "\n".join(lines)


def _commands(command: Any, name: str) -> Iterator[tuple[str, Any]]:
    if command.params:
        yield name, command
    if isinstance(command, TyperGroup):
        context = typer.Context(command, info_name=name)
        for child in command.list_commands(context):
            yield from _commands(command.get_command(context, child), f"{name} {child}")


def configuration_page() -> str:
    """Text of the page of settings files."""
    lines = [_CONFIGURATION_INTRODUCTION]
    for name, about, kind in _FILES:
        lines += [f"## {name}\n", f"{about[0].upper()}{about[1:]}.\n", *_struct_tables(kind, "", {})]
    return "\n".join(lines)


def _struct_tables(
    kind: type[msgspec.Struct], section: str, known: dict[type[msgspec.Struct], str]
) -> list[str]:
    """Lines of one table of a file and those below it; `known` has the section where a kind stands."""
    if kind in known:
        return [f"### `[{section}]`\n", f"The keys of `[{known[kind]}]`.\n"]
    known[kind] = section
    described, hints = _descriptions(kind), get_type_hints(kind)
    rows, below = [], []
    for field in msgspec.structs.fields(kind):
        nested = _nested(hints[field.name])
        place = f"{section}.{field.name}" if section else field.name
        if nested is not None and get_origin(hints[field.name]) is not dict:
            below.append((place, nested))
        rows.append(
            (f"`{field.name}`", _type(hints[field.name]), _field_default(field), described[field.name])
        )
    lines = [f"### `[{section}]`\n"] if section else []
    lines += _table(("key", "type", "default", "meaning"), rows)
    for place, nested in below:
        lines += _struct_tables(nested, place, known)
    return lines


def _nested(hint: Any) -> type[msgspec.Struct] | None:
    for part in (hint, *get_args(hint)):
        if isinstance(part, type) and issubclass(part, msgspec.Struct):
            return part
    return None


def _type(hint: Any) -> str:
    origin, arguments = get_origin(hint), [one for one in get_args(hint) if one is not Ellipsis]
    if origin is Literal:
        return " or ".join(f"`{value}`" for value in arguments)
    if origin in (Union, UnionType):
        return " or ".join(_type(one) for one in arguments if one is not NoneType)
    if origin is dict:
        return f"table of {_type(arguments[1])}"
    if origin is tuple:
        return f"list of {_type(arguments[0])}"
    if isinstance(hint, type) and issubclass(hint, msgspec.Struct):
        return "table"
    words = {"float": "number", "int": "whole number", "str": "text", "bool": "true or false", "Any": "any"}
    return words.get(getattr(hint, "__name__", str(hint)), getattr(hint, "__name__", str(hint)))


def _field_default(field: msgspec.structs.FieldInfo) -> str:
    if field.required:
        return "required"
    value = field.default if field.default is not msgspec.NODEFAULT else None
    if value is None or value in ("", ()) or isinstance(value, msgspec.Struct):
        return ""
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def _descriptions(kind: type) -> dict[str, str]:
    """What the source says of each field, behind it or below it; nothing of a field without a word."""
    source = inspect.getsource(kind)
    lines = source.splitlines()
    (body,) = ast.parse(source).body
    assert isinstance(body, ast.ClassDef)
    found: dict[str, str] = {}
    for place, node in enumerate(body.body):
        if not (isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)):
            continue
        below = body.body[place + 1] if place + 1 < len(body.body) else None
        behind = re.search(r"\s#\s(.*)", lines[(node.end_lineno or node.lineno) - 1])
        if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
            found[node.target.id] = _text(" ".join(str(below.value.value).split()))
        elif behind:
            found[node.target.id] = _text(behind[1])
    return found


def _table(header: tuple[str, ...], rows: list[tuple[str, ...]]) -> list[str]:
    if not rows:
        return []
    cells = [header, tuple("---" for _ in header), *rows]
    return [*(f"| {' | '.join(row)} |" for row in cells), ""]


def _text(text: str | None) -> str:
    return (text or "").replace("|", r"\|").replace("<", r"\<").replace("*", r"\*").rstrip(".")


def main() -> None:
    """Write both pages."""
    OPTIONS.write_text(options_page(), encoding="utf-8")
    CONFIGURATION.write_text(configuration_page(), encoding="utf-8")


if __name__ == "__main__":
    main()
