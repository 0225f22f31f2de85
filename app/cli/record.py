"""`slipstand record`: record one run, or several, from a device."""

import dataclasses
from pathlib import Path
from typing import Any

import msgspec
import typer

from app.acquisition.messages import PortSettings, RunEnded, RunSettings
from app.cli import output as out
from app.cli.errors import CommandError
from app.cli.measurement_options import RecordOptions
from app.cli.option_values import (
    calibration_file,
    checked_conditions,
    device_settings,
    print_mass_overrides,
    recordings_folder,
)
from app.cli.recording import check_recording, record_with_progress
from app.cli.recover import print_unfinished_runs
from config.files import load_stand


def record(options: RecordOptions) -> None:
    """Record a pullback test from a device into a run file."""
    if options.until_rest and options.duration is not None:
        raise CommandError("--duration and --until-rest exclude each other. Give one of them")
    if options.trigger == "none" and options.duration is None:
        raise CommandError("--trigger none has no rest to wait for. Add --duration")
    port = device_settings(options.source)
    run = RunSettings(
        directory=str(recordings_folder(options.directory)),
        series=_checked_series(options.masses.series),
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
        conditions=checked_conditions(options.conditions),
    )
    gauges_file = calibration_file(options.calibration)
    check_recording(run, gauges_file)
    print_mass_overrides(dataclasses.replace(options.masses, series=run.series))
    _record(port, run, gauges_file, options.count, options.as_json)


def _checked_series(series: str | None) -> str | None:
    """Series code as the stand writes it. Raises SeriesError."""
    return None if series is None else load_stand().series(series).code


def _record(port: PortSettings, run: RunSettings, gauges_file: Path, count: int, as_json: bool) -> None:
    print_unfinished_runs(Path(run.directory))
    done: list[RunEnded] = []
    try:
        for ended in record_with_progress(port, run, gauges_file, count):
            done.append(ended)  # noqa: PERF402 - what came before a fault stays
    finally:
        _report(done, count, as_json)
    _exit_by_ending(done, count)


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
    """JSON object of one recorded run (INTERFACE, `record --json`)."""
    time_base = ended.time_base
    document: dict[str, Any] = msgspec.to_builtins(ended) | {"message": str(ended.message)}
    del document["type"], document["remaining"], document["time_base"]
    skew = {"skew_s": time_base.skew_s, "skew_standard_uncertainty_s": time_base.skew_standard_uncertainty_s}
    return {"run": document.pop("path")} | document | skew


_DONE = ("rest", "enough", "duration", "stopped")


def _exit_by_ending(done: list[RunEnded], count: int) -> None:
    """End the command with the code that the end of the last run asks for."""
    last = done[-1] if done else None
    if last is not None and last.ended not in (*_DONE, "interrupted"):
        kept = f" (kept in {last.path})" if last.path else ""
        raise CommandError(f"{last.message or f'the run ended: {last.ended}'}{kept}")
    if last is None or last.ended == "interrupted" or len(done) < count:
        raise typer.Exit(130)
