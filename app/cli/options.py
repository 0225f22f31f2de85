"""Options that several commands share, with the checks that go with them."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.errors import CommandError

if TYPE_CHECKING:
    from app.acquisition.messages import PortSettings
    from app.runs.batch.choice import CrewOptions

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


def crew_options(jobs: int | None, dask: str) -> "CrewOptions":
    """Who is to do the work, from --jobs and --dask. Raises CommandError."""
    from app.runs.batch.choice import CrewOptions

    if jobs is not None and jobs < 1:
        raise CommandError(f"--jobs {jobs} does nothing. Give 1 or more")
    if jobs is not None and dask:
        raise CommandError("--jobs is of this computer, --dask of a cluster. Give one of them")
    return CrewOptions(jobs, dask)
