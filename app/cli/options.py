"""Declarations of options that several commands share.

A command declares its options in a dataclass: a field is an option, or a group of options, which is one
too. `command_function` makes a function of it, so that `--help` imports nothing of what the command does.
"""

import dataclasses
import inspect
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from app.cli.errors import CommandError


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
    hints = get_type_hints(options, include_extras=True)
    for field in dataclasses.fields(options):
        annotation = hints[field.name]
        if dataclasses.is_dataclass(annotation):
            yield from sorted(
                _parameters(annotation), key=lambda option: option.default is not inspect.Parameter.empty
            )
            continue
        default = inspect.Parameter.empty if field.default is dataclasses.MISSING else field.default
        yield inspect.Parameter(
            field.name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation
        )


def choice(name: str, *values: str, help: str) -> Any:  # noqa: A002 - as Typer calls it
    """Declare an option with a choice of values. Others are refused with exit code 1, not as wrong usage."""

    def parse(text: str) -> str:
        if text not in values:
            raise CommandError(f"{name} {text!r} is not known. Use {', '.join(values[:-1])} or {values[-1]}")
        return text

    return typer.Option(name, parser=parse, metavar=f"[{'|'.join(values)}]", help=help)


def number(
    name: str,
    *,
    above: float = -math.inf,
    least: float = -math.inf,
    integer: bool = False,
    help: str,  # noqa: A002
) -> Any:
    """Declare an option with a range of finite numbers. Others are refused with exit code 1.

    Parameters
    ----------
    above : float
        The number must be greater.
    least : float
        The number must be this or greater.
    integer : bool
        Whole numbers only.
    help : str
        Text of `--help`, with the unit.
    """

    def parse(text: str) -> float:
        value = int(text) if integer else float(text)
        check_number(name, value, above=above, least=least)
        return value

    return typer.Option(name, parser=parse, metavar="INTEGER" if integer else "FLOAT", help=help)


def check_number(
    name: str, value: float | None, *, above: float = -math.inf, least: float = -math.inf
) -> None:
    """Refuse a number that is not finite or out of range. Raises CommandError."""
    if value is None or (math.isfinite(value) and value > above and value >= least):
        return
    limit = f" above {above:g}" if above > -math.inf else f", {least:g} or above" if least > -math.inf else ""
    raise CommandError(f"{name} {value:g} must be a finite number{limit}")


Runs = Annotated[list[Path], typer.Argument(help="Run files.", metavar="RUN...")]
RunsOrFolders = Annotated[
    list[Path], typer.Argument(help="Run files, or folders of runs.", metavar="RUN|DIR...")
]
Json = Annotated[bool, typer.Option("--json", help="One JSON document on stdout, nothing else there.")]
Force = Annotated[bool, typer.Option("--force", help="Overwrite an existing output file.")]
SeriesCode = Annotated[str | None, typer.Option("--series", help="Series code, for example 1FFM0.")]
Directory = Annotated[
    Path | None, typer.Option("--directory", help="Folder of the runs; the recordings folder if absent.")
]
Exclude = Annotated[
    list[str] | None,
    typer.Option("--exclude", metavar="RUN[=REASON]", help="A run to leave out, and why; repeatable."),
]
CalibrationFile = Annotated[
    Path | None, typer.Option("--calibration", help="Calibration file; gauges.toml if absent.")
]
GaugeName = Annotated[
    str, choice("--gauge", "table", "relative", help="table (gauge 1) or relative (gauge 2).")
]
FigureFile = Annotated[Path | None, typer.Option("--figure", help="Figure to draw: PNG, SVG or PDF.")]
TableMass = Annotated[
    float | None, number("--table-mass", above=0.0, help="Table mass (kg), if not the stand's.")
]
PlateMass = Annotated[
    float | None, number("--plate-mass", above=0.0, help="Plate mass (kg), if not the series'.")
]
DeviceSettings = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="A setting of the device; repeatable.")
]


@dataclasses.dataclass(frozen=True)
class MassOptions:
    """Series and masses of a test."""

    series: SeriesCode = None
    plate_mass: PlateMass = None
    table_mass: TableMass = None


@dataclasses.dataclass(frozen=True)
class ConditionOptions:
    """Conditions of a test, as `record` and `import` take them."""

    temperature: Annotated[
        float | None, typer.Option("--temperature", help="Air temperature (degrees C).")
    ] = None
    humidity: Annotated[
        float | None, typer.Option("--humidity", help="Relative humidity of the air (%).")
    ] = None
    plate_id: Annotated[str, typer.Option("--plate-id", help="Which upper plate.")] = ""
    contact_id: Annotated[str, typer.Option("--contact-id", help="Which pair of surfaces.")] = ""
    surface: Annotated[str, typer.Option("--surface", help="How the surfaces were prepared.")] = ""
    run_in: Annotated[
        int | None,
        typer.Option("--run-in", help="Which pullback on these surfaces; counted up by `record --count`."),
    ] = None
    condition: Annotated[
        list[str] | None,
        typer.Option("--condition", metavar="NAME=TEXT", help="Any other condition; repeatable."),
    ] = None


@dataclasses.dataclass(frozen=True)
class LinkOptions:
    """How to talk to a device whose port and protocol are known."""

    relative_port: Annotated[
        str,
        typer.Option("--relative-port", help="Port of gauge 2, where each gauge has a device of its own."),
    ] = ""
    rate: Annotated[
        float | None,
        number("--rate", above=0.0, help="Samples a second to ask of the device; its own if absent."),
    ] = None
    baud: Annotated[
        int | None,
        number("--baud", above=0, integer=True, help="Baud rate; the protocol's usual one if absent."),
    ] = None
    parity: Annotated[str, choice("--parity", "N", "E", "O", help="N (none), E (even) or O (odd).")] = "N"
    settings: DeviceSettings = None


@dataclasses.dataclass(frozen=True)
class DeviceOptions(LinkOptions):
    """Which device to read."""

    port: Annotated[
        str, typer.Option("--port", help="Serial port or URL: /dev/ttyUSB0, COM3, socket://host:port.")
    ] = dataclasses.field(kw_only=True)
    protocol: Annotated[
        str, typer.Option("--protocol", help="Protocol name, see `slipstand device list`.")
    ] = dataclasses.field(kw_only=True)


@dataclasses.dataclass(frozen=True)
class JobOptions:
    """Where analyses run."""

    jobs: Annotated[
        int | None,
        typer.Option(
            metavar="N", help="Processes at most; as many as processors if absent, none for few runs."
        ),
    ] = None
    dask: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Run them on a Dask cluster: tcp://HOST:PORT.")
    ] = ""
