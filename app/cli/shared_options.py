"""Options that several commands share, and groups of them."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial

from app.cli.options import REQUIRED, argument, choice, completion, flag, number, option
from app.simulated_stand.effects import LISTED
from config.files import load_stand
from drivers.registry import AVAILABLE


def series_codes() -> Iterable[str]:
    return load_stand().all_series


def _protocols() -> Iterable[str]:
    return (driver.name for driver in AVAILABLE)


run_files = partial(argument, "Run files.", metavar="RUN")
runs_or_folders = partial(argument, "Run files, or folders of runs.", metavar="RUN|FOLDER")
as_json = partial(flag, "--json", "One JSON document on stdout, nothing else there.")
force = partial(flag, "--force", "Overwrite an existing output file.")
series = partial(
    option, "--series", "Series code, for example 1FFM0.", autocompletion=completion(series_codes)
)
directory = partial(option, "--directory", "Folder of the runs; the recordings folder if absent.")
exclude = partial(option, "--exclude", "A run to leave out, and why; repeatable.", metavar="RUN[=REASON]")
calibration = partial(option, "--calibration", "Calibration file; gauges.toml if absent.")
gauge = partial(choice, "--gauge", ("table", "relative"), "table (gauge 1) or relative (gauge 2).")
figure = partial(option, "--figure", "Figure to draw: PNG, SVG or PDF.")
table_mass = partial(number, "--table-mass", "Table mass (kg), if not the stand's.", above=0.0)
plate_mass = partial(number, "--plate-mass", "Plate mass (kg), if not the series'.", above=0.0)
device_settings = partial(option, "--set", "A setting of the device; repeatable.", metavar="KEY=VALUE")
effects = partial(
    option,
    "--effect",
    f"What is not ideal, repeatable (docs/how-to/simulate-a-real-stand.md): {', '.join(LISTED)}.",
    metavar="NAME=VALUE",
    autocompletion=completion([f"{text.partition(' ')[0]}=" for text in LISTED]),
)


@dataclass(frozen=True, kw_only=True)
class MassOptions:
    """Series and masses of a test."""

    series: str | None = series()
    plate_mass: float | None = plate_mass()
    table_mass: float | None = table_mass()


@dataclass(frozen=True, kw_only=True)
class ConditionOptions:
    """Conditions of a test, as `record` and `import` take them."""

    temperature: float | None = option("--temperature", "Air temperature (degrees C).")
    humidity: float | None = option("--humidity", "Relative humidity of the air (%).")
    plate_id: str = option("--plate-id", "Which upper plate.", "")
    contact_id: str = option("--contact-id", "Which pair of surfaces.", "")
    surface: str = option("--surface", "How the surfaces were prepared.", "")
    run_in: int | None = option(
        "--run-in", "Which pullback on these surfaces; counted up by `record --count`."
    )
    condition: list[str] | None = option("--condition", "Another condition; repeatable.", metavar="NAME=TEXT")


@dataclass(frozen=True, kw_only=True)
class LinkOptions:
    """How to talk to a device whose port and protocol are known."""

    relative_port: str = option("--relative-port", "Port of gauge 2, if it has a device of its own.", "")
    rate: float | None = number(
        "--rate", "Samples a second to ask for; the device's own if absent.", above=0.0
    )
    baud: int | None = number(
        "--baud", "Baud rate; the protocol's usual one if absent.", above=0, integer=True
    )
    parity: str | None = choice("--parity", ("N", "E", "O"), "N (none), E (even) or O (odd); N if absent.")
    stop_bits: str | None = choice("--stop-bits", ("1", "2"), "1 or 2; 1 if absent.")
    settings: list[str] | None = device_settings()


@dataclass(frozen=True, kw_only=True)
class DeviceOptions(LinkOptions):
    """Which device to read."""

    port: str = option("--port", "Port or URL: /dev/ttyUSB0, COM3, socket://host:port, lsl://NAME.", REQUIRED)
    protocol: str = option(
        "--protocol",
        "Protocol name, see `slipstand device list`.",
        REQUIRED,
        autocompletion=completion(_protocols),
    )


@dataclass(frozen=True, kw_only=True)
class JobOptions:
    """Where analyses run."""

    jobs: int | None = option(
        "--jobs", "Processes at most; as many as processors if absent, none for few runs.", metavar="N"
    )
    dask: str = option("--dask", "Run them on a Dask cluster: tcp://HOST:PORT.", "", metavar="ADDRESS")
