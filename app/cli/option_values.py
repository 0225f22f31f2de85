"""What shared options stand for: checked settings, masses, conditions and files."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from app.acquisition.messages import PortSettings
from app.cli import output as out
from app.cli.errors import CommandError
from app.cli.options import option_names
from app.cli.shared_options import ConditionOptions, DeviceOptions, JobOptions, LinkOptions, MassOptions
from app.runs.batch.executors import ExecutorOptions
from app.runs.metadata import Conditions
from app.runs.paths import recordings_directory
from app.simulated_stand.options import OutOfRangeError
from config.files import load_stand, settings_file

Options = TypeVar("Options")


def checked(kind: Callable[..., Options], declared: type[Any] | None = None, /, **values: Any) -> Options:
    """Build options that check their values. Raises CommandError for a value out of range.

    `declared` are the options of the command line with the same fields: an error calls one by its name there.
    """
    try:
        return kind(**values)
    except OutOfRangeError as error:
        name = option_names(declared).get(error.field) if declared else None
        raise CommandError(f"{name} {error.fault}" if name else str(error)) from None
    except ValueError as error:
        raise CommandError(str(error)) from None


def print_mass_overrides(masses: MassOptions) -> None:
    """Print which masses replace those of stand and series. Raises ConfigError for an unknown series."""
    stand = load_stand()
    series = stand.series(masses.series) if masses.series else None
    plate_kg, owner = (
        (series.plate_mass_kg, f"series {series.code}") if series else (stand.plate_mass_kg, "the stand")
    )
    for name, given, usual, source in (
        ("table", masses.table_mass, stand.table_mass_kg, "the stand"),
        ("plate", masses.plate_mass, plate_kg, owner),
    ):
        if given is not None and given != usual:
            out.print_status(
                f"note: the {name} mass is {given:g} kg as given, not the {usual:g} kg of {source}"
            )


def checked_conditions(options: ConditionOptions) -> Conditions:
    """Return the checked conditions. Raises CommandError, MetadataError."""
    return Conditions(
        temperature_c=options.temperature,
        humidity_percent=options.humidity,
        plate_id=options.plate_id.strip(),
        contact_id=options.contact_id.strip(),
        surface_preparation=options.surface.strip(),
        run_in_number=options.run_in,
        other=key_values(options.condition, "--condition"),
    )


def device_settings(options: DeviceOptions) -> PortSettings:
    """Return the settings of a device. Raises CommandError."""
    return port_settings(options, options.port, options.protocol)


def port_settings(options: LinkOptions, port: str, protocol: str) -> PortSettings:
    """Return the settings of the device on a port. Raises CommandError."""
    return PortSettings(
        url=port,
        protocol=protocol,
        baud=options.baud,
        parity=options.parity,
        stop_bits=None if options.stop_bits is None else int(options.stop_bits),
        rate_hz=options.rate,
        device=key_values(options.settings),
        relative_url=options.relative_port,
    )


def executor_options(options: JobOptions) -> ExecutorOptions:
    """Return the options of the executor. Raises CommandError."""
    if options.jobs is not None and options.jobs < 1:
        raise CommandError(f"--jobs {options.jobs} does nothing. Give 1 or more")
    if options.jobs is not None and options.dask:
        raise CommandError("--jobs is for this computer, --dask for a cluster. Give one of them")
    return ExecutorOptions(options.jobs, options.dask)


_EXAMPLES = {"--set": "separator=;", "--condition": "temperature_c=21.5", "--effect": "release-ramp=0.01"}


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


def figure_file(given: Path | None, *, force: bool = True) -> Path | None:
    """Return the path of a figure to draw. Raises CommandError for an unknown format or a missing folder."""
    return out.output_file(given, force, (".png", ".svg", ".pdf"), "--figure") if given else None


def recordings_folder(given: Path | None) -> Path:
    """Return the folder to record into: the one given, or that of recordings."""
    return given.expanduser().resolve() if given else recordings_directory()
