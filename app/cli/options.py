"""Declarations of options.

A command declares its options in a dataclass: a field is an option (`option`, `flag`, `number`, `choice`,
`argument`), or a dataclass of options. `command_function` makes a function of it, so that `--help` imports
nothing of what the command does.
"""

import copy
import dataclasses
import datetime
import inspect
import math
import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, Final, get_args, get_type_hints

import typer

from app.cli.errors import CommandError, alternatives

REQUIRED: Final[Any] = dataclasses.MISSING  # default of an option that must be given
_METAVARS: Final = {
    "--author": "NAME", "--begun": "TIME", "--by": "NAME", "--column": "NAME", "--operator": "NAME",
    "--port": "URL", "--protocol": "NAME", "--relative-port": "URL", "--series": "CODE", "--since": "DATE",
}  # fmt: skip
"""What stands for the value of an option in `--help`, where neither its unit nor its type tells."""
_UNIT: Final = re.compile(r"\((m/s|mm|m|kg/s|kg|s|Hz|1/s|N/m|rad|ppm|%|degrees C)\)")
_UNIT_IN_WORDS: Final = (("amples a second", "HZ"), ("ows a second", "HZ"), ("econds", "S"))


def option(names: str, description: str, default: Any = None, **settings: Any) -> Any:
    """Declare an option of these names, "-o --output", with further settings of `typer.Option`."""
    return _field(typer.Option(*names.split(), help=description, **settings), default, names)


def flag(name: str, description: str) -> Any:
    """Declare an option without a value, which is off by default."""
    return option(name, description, False)


def argument(description: str, default: Any = REQUIRED, *, metavar: str | None = None) -> Any:
    """Declare an argument."""
    return _field(typer.Argument(help=description, metavar=metavar), default)


def choice(name: str, values: tuple[str, ...], description: str, default: Any = None) -> Any:
    """Declare an option with a choice of values. Others are refused with exit code 1, not as wrong usage."""

    def parse(text: str) -> str:
        if text not in values:
            raise CommandError(f"{name} {text!r} is not known. Use {alternatives(values)}")
        return text

    settings = {"parser": parse, "metavar": f"[{'|'.join(values)}]", "autocompletion": completion(values)}
    return option(name, description, default, **settings)


def completion(values: Iterable[str] | Callable[[], Iterable[str]]) -> Callable[[str], list[str]]:
    """Return what completes a value in a shell. A function gives the values when they are asked for."""

    def complete(incomplete: str) -> list[str]:
        known = values() if callable(values) else values
        return [value for value in known if value.startswith(incomplete)]

    return complete


def number(
    name: str,
    description: str,
    default: Any = None,
    *,
    above: float = -math.inf,
    least: float = -math.inf,
    integer: bool = False,
) -> Any:
    """Declare a finite number `> above` and `>= least`. Others are refused with exit code 1."""

    def parse(text: str) -> float:
        value = int(text) if integer else float(text)
        if math.isfinite(value) and value > above and value >= least:
            return value
        limit = "" if least == -math.inf else f", {least:g} or above"
        limit = limit if above == -math.inf else f" above {above:g}"
        raise CommandError(f"{name} {value:g} must be a finite number{limit}")

    return option(name, description, default, parser=parse)


def option_names(options: type[Any]) -> dict[str, str]:
    """The long name of each option, by its field: `rest_s` is `--rest`."""
    declared = ((field.name, field.metadata.get("names")) for field in dataclasses.fields(options))
    return {field: names.split()[-1] for field, names in declared if names}


def _field(declaration: Any, default: Any, names: str = "") -> Any:
    return dataclasses.field(default=default, metadata={"typer": declaration, "names": names})


def command_function(options: type[Any], run: Callable[[Any], None]) -> Callable[..., None]:
    """Return a function, as Typer needs it, with a parameter for each option; it calls `run(options)`.

    As the function of a group it leaves the work to the subcommand where one is given.
    """
    context = inspect.Parameter("context", inspect.Parameter.KEYWORD_ONLY, annotation=typer.Context)

    def command(context: typer.Context, **values: Any) -> None:
        if context.invoked_subcommand is None:
            run(_collect(options, values))

    command.__doc__ = options.__doc__
    command.__signature__ = inspect.Signature([context, *_parameters(options)])  # type: ignore[attr-defined]
    command.__annotations__ = {}
    return command


def _collect(options: Any, values: dict[str, Any]) -> Any:
    """Build the dataclass and the groups in it."""
    given = {}
    for name, annotation in get_type_hints(options).items():
        given[name] = _collect(annotation, values) if dataclasses.is_dataclass(annotation) else values[name]
    return options(**given)


def _parameters(options: Any) -> Iterator[inspect.Parameter]:
    """Yield a parameter for each option, groups expanded; in a group required options stand first."""
    empty = inspect.Parameter.empty
    hints = get_type_hints(options)
    for field in dataclasses.fields(options):
        hint = hints[field.name]
        if dataclasses.is_dataclass(hint):
            yield from sorted(_parameters(hint), key=lambda parameter: parameter.default is not empty)
            continue
        yield inspect.Parameter(
            field.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=empty if field.default is REQUIRED else field.default,
            annotation=Annotated[hint, _with_metavar(field.metadata, hint)],
        )


def _with_metavar(declared: Any, hint: Any) -> Any:
    """Return the declaration of an option with a name for its value, which `--help` shows."""
    declaration = declared["typer"]
    if declaration.metavar or not declared["names"]:
        return declaration
    declaration = copy.copy(declaration)
    declaration.metavar = _metavar(declared["names"].split()[-1], declaration.help, hint)
    return declaration


def _metavar(name: str, description: str, hint: Any) -> str | None:
    """`KG`, `CODE`, `DATE`: what is to be given. None for a flag."""
    types = {hint, *get_args(hint), *(inner for one in get_args(hint) for inner in get_args(one))}
    if bool in types:
        return None
    if datetime.datetime in types:
        return "DATE"
    if Path in types:
        return "FOLDER" if description.startswith("Folder") else "FILE"
    if float in types:
        if unit := _UNIT.search(description):
            return {"%": "PERCENT", "degrees C": "CELSIUS"}.get(unit[1], unit[1].upper())
        return next((unit for words, unit in _UNIT_IN_WORDS if words in description), "NUMBER")
    return "N" if int in types else _METAVARS.get(name, "TEXT")
