"""`slipstand record`: record one run, or several, from a device."""

import dataclasses
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer

from app.acquisition.messages import PortSettings, RunEnded, RunSettings
from app.cli import output as out
from app.cli.errors import CommandError
from app.cli.options import (
    CalibrationFile,
    ConditionOptions,
    DeviceOptions,
    Directory,
    Json,
    MassOptions,
    calibration_file,
    choice,
    number,
    with_options,
)
from app.cli.recording import check_recording, record_with_progress
from app.cli.recover import print_unfinished_runs
from app.runs.paths import recordings_directory
from config.files import load_stand


@with_options
def record(
    *,
    source: DeviceOptions,
    masses: MassOptions,
    pullback: Annotated[
        float | None, number("--pullback", above=0.0, help="Pullback (m), if not the series'.")
    ] = None,
    tolerance: Annotated[
        float | None,
        number(
            "--tolerance", above=0.0, help="How far off the pullback it may be held (m); 2 % of it if absent."
        ),
    ] = None,
    duration: Annotated[
        float | None,
        number("--duration", above=0.0, help="Seconds after release, or from the start with --trigger none."),
    ] = None,
    until_rest: Annotated[
        bool, typer.Option("--until-rest", help="End at rest or when enough; the default without --duration.")
    ] = False,
    trigger: Annotated[
        str, choice("--trigger", "pullback", "none", help="pullback, or none to record at once.")
    ] = "pullback",
    pretrigger: Annotated[float, typer.Option(help="Seconds kept from before the release.")] = 1.0,
    trigger_timeout: Annotated[
        float, number("--trigger-timeout", above=0.0, help="Seconds to wait for a release.")
    ] = 600.0,
    calibration: CalibrationFile = None,
    directory: Directory = None,
    operator: Annotated[str, typer.Option(help="Who records.")] = "",
    note: Annotated[str, typer.Option(help="A remark kept with the run.")] = "",
    conditions: ConditionOptions,
    count: Annotated[int, typer.Option(min=1, help="How many runs, one after another.")] = 1,
    as_json: Json = False,
) -> None:
    """Record a pullback test from a device into a run file.

    Ctrl-C ends the run and keeps it. With --count the next run arms itself when one is stored, without the
    keyboard.
    """
    if until_rest and duration is not None:
        raise CommandError("--duration and --until-rest exclude each other. Give one of them")
    if trigger == "none" and duration is None:
        raise CommandError("--trigger none has no rest to wait for. Add --duration")
    port = source.device()
    run = RunSettings(
        directory=str(directory.expanduser().resolve() if directory else recordings_directory()),
        series=_checked_series(masses.series),
        pullback_m=pullback,
        pullback_tolerance_m=tolerance,
        plate_mass_kg=masses.plate_mass,
        table_mass_kg=masses.table_mass,
        trigger=trigger,
        pretrigger_s=pretrigger,
        duration_s=duration,
        trigger_timeout_s=trigger_timeout,
        operator=operator,
        note=note,
        conditions=conditions.conditions(),
    )
    gauges_file = calibration_file(calibration)
    check_recording(run, gauges_file)
    dataclasses.replace(masses, series=run.series).print_overrides()
    _record(port, run, gauges_file, count, as_json)


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
