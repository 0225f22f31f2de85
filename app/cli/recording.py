"""Recording from the command line: through the engine, with the operator told what to do."""

import contextlib
import datetime
import tempfile
from collections.abc import Iterator
from pathlib import Path

from app.acquisition.engine_client import record_runs
from app.acquisition.messages import PortSettings, RunEnded, RunSettings
from app.acquisition.run_setup import check_run_settings
from app.cli import output as out
from app.cli.errors import CommandError
from app.cli.progress_printer import ProgressPrinter, StatusLine
from app.runs.analysis_json import calibration_warnings, gauge_check_warnings
from app.runs.metadata import create_metadata
from config.files import load_checks, load_gauges, load_stand, settings_file
from drivers.registry import DRIVERS


def record_with_progress(
    port: PortSettings,
    run: RunSettings,
    gauges_file: Path,
    count: int = 1,
    *,
    simulated: bool = False,
) -> Iterator[RunEnded]:
    """Record runs over one connection, telling what goes on; yield each at its end, like `record_runs`."""
    verified = "" if simulated or port.protocol not in DRIVERS else DRIVERS[port.protocol].verified
    on_base = load_gauges(gauges_file).relative.measures == "plate"
    with StatusLine() as line:
        printer = ProgressPrinter(
            line, count, gauge_2_on_base=on_base, simulated=simulated, verified=verified
        )
        files = (str(settings_file("stand.toml")), str(gauges_file))
        with contextlib.closing(
            record_runs(port, run, *files, printer.on_event, printer.on_rows, count)
        ) as runs:
            yield from runs


def check_recording(run: RunSettings, gauges_file: Path) -> None:
    """Refuse what no run can have, before any port is opened, and say which calibration has expired.

    Raises CommandError, AcquisitionError, ConfigError, RunError.
    """
    check_run_settings(run)
    gauges, now = load_gauges(gauges_file), datetime.datetime.now().astimezone()
    failed = gauge_check_warnings(load_checks().latest_checks(gauges))
    for caution in [*calibration_warnings(gauges, now.date()), *failed]:
        out.print_status(f"warning: {caution.message}")
    create_metadata(
        load_stand(),
        gauges,
        now,
        series=run.series,
        plate_mass_kg=run.plate_mass_kg,
        table_mass_kg=run.table_mass_kg,
        conditions=run.conditions,
    )
    _check_folder(Path(run.directory))


def _check_folder(folder: Path) -> None:
    """Refuse a folder that runs cannot be written into; one that is not there yet can be made."""
    there = next((place for place in (folder, *folder.parents) if place.exists()), folder)
    if not there.is_dir():
        raise CommandError(f"--directory {folder}: {there} is not a folder. Choose another one")
    try:
        with tempfile.TemporaryFile(dir=there):
            pass
    except OSError as error:
        fault = error.strerror or type(error).__name__
        raise CommandError(
            f"--directory {folder} cannot be written into ({fault}). Choose another one"
        ) from None
