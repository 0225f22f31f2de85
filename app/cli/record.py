"""`slipstand record`: record one run, or several, from a device."""

import contextlib
import datetime
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import typer

from app.acquisition.engine_client import record_runs
from app.acquisition.messages import PortSettings, RunEnded, RunSettings
from app.acquisition.run_setup import check_run_settings
from app.cli import option_values
from app.cli import output as out
from app.cli.errors import CommandError
from app.cli.measurement_options import RecordOptions
from app.cli.progress_printer import ProgressPrinter, StatusLine
from app.cli.recover import print_unfinished_runs
from app.runs.analysis_json import calibration_warnings, gauge_check_warnings
from app.runs.metadata import create_metadata
from config.files import load_checks, load_gauges, load_stand, settings_file
from drivers.registry import DRIVERS

_DONE = ("rest", "enough", "duration", "stopped")


def record(options: RecordOptions) -> None:
    if options.until_rest and options.duration is not None:
        raise CommandError("--duration and --until-rest exclude each other. Give one of them")
    if options.trigger == "none" and options.duration is None:
        raise CommandError("--trigger none has no rest to wait for. Add --duration")
    port = option_values.device_settings(options.source)
    run = RunSettings(
        directory=str(option_values.recordings_folder(options.directory)),
        series=load_stand().series(options.masses.series).code if options.masses.series else None,
        pullback_m=options.pullback,
        pullback_tolerance_m=options.tolerance,
        plate_mass_kg=options.masses.plate_mass,
        table_mass_kg=options.masses.table_mass,
        trigger=options.trigger,
        pretrigger_s=options.pretrigger,
        duration_s=options.duration,
        trigger_timeout_s=options.trigger_timeout,
        operator=options.operator,
        note=options.note,
        conditions=option_values.checked_conditions(options.conditions),
    )
    gauges_file = option_values.calibration_file(options.calibration)
    check_recording(run, gauges_file)
    option_values.print_mass_overrides(options.masses)
    print_unfinished_runs(Path(run.directory))
    done: list[RunEnded] = []
    try:
        for ended in record_with_progress(port, run, gauges_file, options.count):
            done.append(ended)  # noqa: PERF402 - what came before a fault stays
    finally:
        _report(done, options.count, options.as_json)
    _exit_by_ending(done, options.count)


def _report(done: list[RunEnded], count: int, as_json: bool) -> None:
    """Say what is there, also when something else failed."""
    stored = [one for one in done if one.path]
    if as_json and (stored or count > 1):
        documents = [run_document(one) for one in stored]
        out.print_json(documents if count > 1 else documents[0])
    elif not as_json:
        for one in stored:
            out.print_line(f"{one.path}: {one.samples} samples, ended: {one.ended}")
        if count > 1:
            out.print_line(f"{len(stored)} of {count} runs recorded")


def run_document(ended: RunEnded) -> dict[str, Any]:
    """JSON object of one recorded run (`record --json`)."""
    time_base = ended.time_base
    document: dict[str, Any] = msgspec.to_builtins(ended) | {"message": str(ended.message)}
    del document["type"], document["remaining"], document["time_base"]
    skew = {"skew_s": time_base.skew_s, "skew_standard_uncertainty_s": time_base.skew_standard_uncertainty_s}
    return {"run": document.pop("path")} | document | skew


def _exit_by_ending(done: list[RunEnded], count: int) -> None:
    """End the command with the code that the end of the last run asks for."""
    last = done[-1] if done else None
    if last is not None and last.ended not in (*_DONE, "interrupted"):
        kept = f" (kept in {last.path})" if last.path else ""
        raise CommandError(f"{last.message or f'the run ended: {last.ended}'}{kept}")
    if last is None or last.ended == "interrupted" or len(done) < count:
        raise typer.Exit(130)


def record_with_progress(
    port: PortSettings, run: RunSettings, gauges_file: Path, count: int = 1, *, simulated: bool = False
) -> Iterator[RunEnded]:
    """Record runs over one connection, and print the progress; yield each run at its end."""
    verified = "" if simulated or port.protocol not in DRIVERS else DRIVERS[port.protocol].verified
    on_base = load_gauges(gauges_file).relative.measures == "plate"
    with StatusLine() as line:
        printer = ProgressPrinter(line, count, simulated, verified, gauge_2_on_base=on_base)
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
