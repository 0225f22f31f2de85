"""Options that several commands share, with the checks that go with them."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli import output as out
from app.cli.errors import CommandError

if TYPE_CHECKING:
    from app.acquisition.messages import PortSettings
    from app.runs.batch.executors import ExecutorOptions
    from app.runs.metadata import Conditions

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
TableMass = Annotated[float | None, typer.Option("--table-mass", help="Table mass (kg), if not the stand's.")]
PlateMass = Annotated[float | None, typer.Option("--plate-mass", help="Plate mass (kg), if not the series'.")]
DeviceSettings = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="A setting of the device; repeatable.")
]
Jobs = Annotated[
    int | None,
    typer.Option(metavar="N", help="Processes at most; as many as processors if absent, none for few runs."),
]
Exclude = Annotated[
    list[str] | None,
    typer.Option(
        "--exclude", metavar="RUN[=REASON]", help="A run that is not to count, and why; repeatable."
    ),
]
Dask = Annotated[
    str, typer.Option(metavar="ADDRESS", help="Have the workers of a Dask cluster do it: tcp://HOST:PORT.")
]

DeviceRate = Annotated[
    float | None, typer.Option("--rate", help="Samples a second to ask of the device; its own if absent.")
]
Baud = Annotated[int | None, typer.Option("--baud", help="Baud rate; the protocol's usual one if absent.")]
Parity = Annotated[str, typer.Option("--parity", help="N (none), E (even) or O (odd).")]
RelativePort = Annotated[
    str, typer.Option("--relative-port", help="Port of gauge 2, where each gauge has a device of its own.")
]


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


def finite(name: str, value: float | None, least: float = float("-inf")) -> None:
    """Refuse a number that is not finite, or below `least`. Raises CommandError."""
    if value is not None and not (float("-inf") < value < float("inf") and value >= least):
        limit = f", {least:g} or above" if least > float("-inf") else ""
        raise CommandError(f"{name} {value:g} must be a finite number{limit}")


def positive(name: str, value: float | None) -> None:
    """Refuse a number that is not finite and above 0. Raises CommandError."""
    if value is not None and not 0.0 < value < float("inf"):
        raise CommandError(f"{name} {value:g} must be a finite number above 0")


def port_settings(
    url: str,
    protocol: str,
    relative_port: str,
    rate: float | None,
    baud: int | None,
    parity: str,
    settings: list[str] | None,
) -> "PortSettings":
    """Which wire to read, by the options of that name. Raises CommandError."""
    from app.acquisition.messages import PortSettings

    positive("--rate", rate)
    positive("--baud", baud)
    if parity not in ("N", "E", "O"):
        raise CommandError(f"--parity {parity!r} is not known. Use N, E or O")
    return PortSettings(url, protocol, baud, parity, rate, key_values(settings), relative_port)


def executor_options(jobs: int | None, dask: str) -> "ExecutorOptions":
    """Who is to do the work, from --jobs and --dask. Raises CommandError."""
    from app.runs.batch.executors import ExecutorOptions

    if jobs is not None and jobs < 1:
        raise CommandError(f"--jobs {jobs} does nothing. Give 1 or more")
    if jobs is not None and dask:
        raise CommandError("--jobs is of this computer, --dask of a cluster. Give one of them")
    return ExecutorOptions(jobs, dask)


def print_mass_overrides(
    series: str | None, table_mass_kg: float | None, plate_mass_kg: float | None
) -> None:
    """Say on stderr which masses stand for others. Raises ConfigError for a series that is not one."""
    from config.files import load_stand

    stand = load_stand()
    of_series = stand.series(series) if series else None
    plate = of_series.plate_mass_kg if of_series else stand.plate_mass_kg
    whose = f"series {of_series.code}" if of_series else "the stand"
    for name, given, usual, source in (
        ("table", table_mass_kg, stand.table_mass_kg, "the stand"),
        ("plate", plate_mass_kg, plate, whose),
    ):
        if given is not None and given != usual:
            out.print_status(
                f"note: the {name} mass is {given:g} kg as given, not the {usual:g} kg of {source}"
            )


Temperature = Annotated[float | None, typer.Option("--temperature", help="Air temperature (degrees C).")]
Humidity = Annotated[float | None, typer.Option("--humidity", help="Relative humidity of the air (%).")]
PlateId = Annotated[str, typer.Option("--plate-id", help="Which upper plate.")]
ContactId = Annotated[str, typer.Option("--contact-id", help="Which pair of surfaces.")]
Surface = Annotated[str, typer.Option("--surface", help="How the surfaces were prepared.")]
RunIn = Annotated[
    int | None,
    typer.Option("--run-in", help="Which pullback on these surfaces; counted up by `record --count`."),
]
OtherConditions = Annotated[
    list[str] | None,
    typer.Option("--condition", metavar="NAME=TEXT", help="Any other circumstance; repeatable."),
]


def build_conditions(
    temperature: float | None,
    humidity: float | None,
    plate_id: str,
    contact_id: str,
    surface: str,
    run_in: int | None,
    other: list[str] | None,
) -> "Conditions":
    """Put the options together, checked. Raises CommandError, MetadataError."""
    from app.runs.metadata import Conditions

    return Conditions(
        temperature_c=temperature,
        humidity_percent=humidity,
        plate_id=plate_id.strip(),
        contact_id=contact_id.strip(),
        surface_preparation=surface.strip(),
        run_in_number=run_in,
        other=key_values(other, "--condition"),
    )
