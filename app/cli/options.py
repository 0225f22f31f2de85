"""Options that several commands share, with their checks.

An option group is a dataclass: a field is an option. `with_options` expands the groups among a function's
parameters, so that Typer sees one parameter an option, and the function one object a group.
"""

import dataclasses
import functools
import inspect
import math
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from app.acquisition.messages import PortSettings
from app.cli import output as out
from app.cli.errors import CommandError
from app.runs.batch.executors import ExecutorOptions
from app.runs.metadata import Conditions
from config.files import load_stand, settings_file


def with_options(function: Callable[..., None]) -> Callable[..., None]:
    """Expand the option groups among the parameters of a command."""
    signature = inspect.signature(function)
    groups: dict[str, type] = {
        name: parameter.annotation
        for name, parameter in signature.parameters.items()
        if isinstance(parameter.annotation, type) and dataclasses.is_dataclass(parameter.annotation)
    }

    @functools.wraps(function)
    def command(**values: Any) -> None:
        for name, group in groups.items():
            given = {field.name for field in dataclasses.fields(group)} & values.keys()
            values[name] = group(**{field: values.pop(field) for field in given})
        function(**values)

    parameters = [
        option
        for name, parameter in signature.parameters.items()
        for option in (_options_of(groups[name]) if name in groups else [parameter])
    ]
    command.__signature__ = signature.replace(  # type: ignore[attr-defined]
        parameters=[option.replace(kind=inspect.Parameter.KEYWORD_ONLY) for option in parameters]
    )
    command.__annotations__ = {}
    return command


def _options_of(group: type) -> list[inspect.Parameter]:
    hints = get_type_hints(group, include_extras=True)
    required = [field for field in dataclasses.fields(group) if field.default is dataclasses.MISSING]
    optional = [field for field in dataclasses.fields(group) if field.default is not dataclasses.MISSING]
    return [
        inspect.Parameter(
            field.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=inspect.Parameter.empty if field in required else field.default,
            annotation=hints[field.name],
        )
        for field in (*required, *optional)
    ]


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
    name : str
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

    def print_overrides(self) -> None:
        """Print which masses replace those of stand and series. Raises ConfigError for an unknown series."""
        stand = load_stand()
        series = stand.series(self.series) if self.series else None
        plate_kg, owner = (
            (series.plate_mass_kg, f"series {series.code}") if series else (stand.plate_mass_kg, "the stand")
        )
        for name, given, usual, source in (
            ("table", self.table_mass, stand.table_mass_kg, "the stand"),
            ("plate", self.plate_mass, plate_kg, owner),
        ):
            if given is not None and given != usual:
                out.print_status(
                    f"note: the {name} mass is {given:g} kg as given, not the {usual:g} kg of {source}"
                )


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

    def conditions(self) -> Conditions:
        """Return the checked conditions. Raises CommandError, MetadataError."""
        return Conditions(
            temperature_c=self.temperature,
            humidity_percent=self.humidity,
            plate_id=self.plate_id.strip(),
            contact_id=self.contact_id.strip(),
            surface_preparation=self.surface.strip(),
            run_in_number=self.run_in,
            other=key_values(self.condition, "--condition"),
        )


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

    def port_settings(self, port: str, protocol: str) -> PortSettings:
        """Return the settings of the device on a port. Raises CommandError."""
        return PortSettings(
            url=port,
            protocol=protocol,
            baud=self.baud,
            parity=self.parity,
            rate_hz=self.rate,
            device=key_values(self.settings),
            relative_url=self.relative_port,
        )


@dataclasses.dataclass(frozen=True)
class DeviceOptions(LinkOptions):
    """Which device to read."""

    port: Annotated[
        str, typer.Option("--port", help="Serial port or URL: /dev/ttyUSB0, COM3, socket://host:port.")
    ] = dataclasses.field(kw_only=True)
    protocol: Annotated[
        str, typer.Option("--protocol", help="Protocol name, see `slipstand device list`.")
    ] = dataclasses.field(kw_only=True)

    def device(self) -> PortSettings:
        """Return the settings of the device. Raises CommandError."""
        return self.port_settings(self.port, self.protocol)


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

    def executor(self) -> ExecutorOptions:
        """Return the options of the executor. Raises CommandError."""
        if self.jobs is not None and self.jobs < 1:
            raise CommandError(f"--jobs {self.jobs} does nothing. Give 1 or more")
        if self.jobs is not None and self.dask:
            raise CommandError("--jobs is for this computer, --dask for a cluster. Give one of them")
        return ExecutorOptions(self.jobs, self.dask)


_EXAMPLES = {"--set": "separator=;", "--condition": "temperature_c=21.5"}


def key_values(pairs: list[str] | None, option: str = "--set") -> dict[str, str]:
    """Turn the KEY=VALUE pairs of an option into a dict. Raises CommandError."""
    settings = {}
    for pair in pairs or []:
        key, equals, value = pair.partition("=")
        if not equals or not key.strip():
            raise CommandError(
                f"{option} {pair!r} must be KEY=VALUE, for example {option} {_EXAMPLES[option]}"
            )
        settings[key.strip()] = value
    return settings


def calibration_file(given: Path | None) -> Path:
    """Return the calibration file to use: the one given, or gauges.toml."""
    return given.expanduser().resolve() if given else settings_file("gauges.toml")


def check_figure_file(figure: Path | None) -> Path | None:
    """Return the path of a figure to draw. Raises CommandError for an unknown format or a missing folder."""
    if figure is None:
        return None
    if figure.suffix not in (".png", ".svg", ".pdf"):
        raise CommandError(f"--figure {figure.name} has no known ending. Use .png, .svg or .pdf")
    if not figure.expanduser().absolute().parent.is_dir():
        raise CommandError(
            f"--figure {figure}: there is no such folder. Make it first or choose another path"
        )
    return figure.expanduser()
