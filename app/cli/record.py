"""`slipstand record`: record one run, or several, from a device."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.errors import CommandError
from app.cli.options import (
    Baud,
    ContactId,
    DeviceRate,
    DeviceSettings,
    Directory,
    Humidity,
    Json,
    OtherConditions,
    Parity,
    PlateId,
    PlateMass,
    RelativePort,
    RunIn,
    SeriesCode,
    Surface,
    TableMass,
    Temperature,
    build_conditions,
    key_values,
    positive,
    print_mass_overrides,
)

if TYPE_CHECKING:
    from app.acquisition.messages import PortSettings, RunEnded, RunSettings


def record(
    port: Annotated[str, typer.Option(help="Serial port or URL: /dev/ttyUSB0, COM3, socket://host:port.")],
    protocol: Annotated[str, typer.Option(help="Protocol name, see `slipstand device list`.")],
    relative_port: RelativePort = "",
    series: SeriesCode = None,
    pullback: Annotated[float | None, typer.Option(help="Pullback (m), if not the series'.")] = None,
    tolerance: Annotated[
        float | None, typer.Option(help="How far off the pullback it may be held (m); 2 % of it if absent.")
    ] = None,
    plate_mass: PlateMass = None,
    table_mass: TableMass = None,
    rate: DeviceRate = None,
    baud: Baud = None,
    parity: Parity = "N",
    duration: Annotated[
        float | None, typer.Option(help="Seconds after release, or from the start with --trigger none.")
    ] = None,
    until_rest: Annotated[
        bool, typer.Option("--until-rest", help="End at rest or when enough; the default without --duration.")
    ] = False,
    trigger: Annotated[str, typer.Option(help="pullback, or none to record at once.")] = "pullback",
    pretrigger: Annotated[float, typer.Option(help="Seconds kept from before the release.")] = 1.0,
    trigger_timeout: Annotated[float, typer.Option(help="Seconds to wait for a release.")] = 600.0,
    calibration: Annotated[Path | None, typer.Option(help="Calibration file; gauges.toml if absent.")] = None,
    directory: Directory = None,
    operator: Annotated[str, typer.Option(help="Who records.")] = "",
    note: Annotated[str, typer.Option(help="A remark kept with the run.")] = "",
    temperature: Temperature = None,
    humidity: Humidity = None,
    plate_id: PlateId = "",
    contact_id: ContactId = "",
    surface: Surface = "",
    run_in: RunIn = None,
    condition: OtherConditions = None,
    count: Annotated[int, typer.Option(min=1, help="How many runs, one after another.")] = 1,
    settings: DeviceSettings = None,
    as_json: Json = False,
) -> None:
    """Record a pullback test from a device into a run file.

    Ctrl-C ends the run and keeps it. With --count the next run arms itself as soon as
    one is stored: nobody has to touch the keyboard.
    """
    from app.acquisition.messages import PortSettings, RunSettings
    from app.cli.recording import calibration_file, check_run_settings
    from app.runs.paths import recordings_directory

    numbers = {
        "--duration": duration, "--rate": rate, "--trigger-timeout": trigger_timeout, "--baud": baud,
        "--plate-mass": plate_mass, "--table-mass": table_mass, "--tolerance": tolerance,
        "--pullback": pullback,
    }  # fmt: skip
    for name, value in numbers.items():
        positive(name, value)
    _check_words(trigger, parity, duration, until_rest)
    ports = PortSettings(
        url=port,
        protocol=protocol,
        baud=baud,
        parity=parity,
        rate_hz=rate,
        device=key_values(settings),
        relative_url=relative_port,
    )
    run = RunSettings(
        directory=str(directory.expanduser().resolve() if directory else recordings_directory()),
        series=_checked_series(series), pullback_m=pullback, pullback_tolerance_m=tolerance,
        plate_mass_kg=plate_mass, table_mass_kg=table_mass, trigger=trigger,
        pretrigger_s=pretrigger, duration_s=duration, trigger_timeout_s=trigger_timeout,
        operator=operator, note=note,
        conditions=build_conditions(
            temperature, humidity, plate_id, contact_id, surface, run_in, condition
        ),
    )  # fmt: skip
    gauges_file = calibration_file(calibration)
    check_run_settings(run, gauges_file)
    print_mass_overrides(run.series, table_mass, plate_mass)
    _record(ports, run, gauges_file, count, as_json)


def _check_words(trigger: str, parity: str, duration: float | None, until_rest: bool) -> None:
    if until_rest and duration is not None:
        raise CommandError("--duration and --until-rest exclude each other. Give one of them")
    if parity not in ("N", "E", "O"):
        raise CommandError(f"--parity {parity!r} is not known. Use N, E or O")
    if trigger not in ("pullback", "none"):
        raise CommandError(f"--trigger {trigger!r} is not known. Use pullback or none")
    if trigger == "none" and duration is None:
        raise CommandError("--trigger none has no rest to wait for. Add --duration")


def _checked_series(series: str | None) -> str | None:
    """Series code as the stand writes it. Raises SeriesError."""
    from config.files import load_stand

    return None if series is None else load_stand().series(series).code


def _record(port: "PortSettings", run: "RunSettings", gauges_file: Path, count: int, as_json: bool) -> None:
    from app.cli.recording import record_with_progress
    from app.cli.recover import print_unfinished_runs

    print_unfinished_runs(Path(run.directory))
    done: list[RunEnded] = []
    try:
        for ended in record_with_progress(port, run, gauges_file, count):
            done.append(ended)  # noqa: PERF402 - what came before a fault stays
    finally:
        _report(done, count, as_json)
    _exit_by_ending(done, count)


def _report(done: "list[RunEnded]", count: int, as_json: bool) -> None:
    """Say what is there, also when something else failed."""
    from app.cli import output as out

    stored = [one for one in done if one.path]
    if as_json and (stored or count > 1):
        documents = [run_document(one) for one in stored]
        out.print_json(documents if count > 1 else documents[0])
    elif not as_json:
        for one in stored:
            out.print_line(f"{one.path}: {one.samples} samples, ended: {one.ended}")
        if count > 1:
            out.print_line(f"{len(stored)} of {count} runs recorded")


def run_document(ended: "RunEnded") -> dict[str, Any]:
    """JSON object of one recorded run (INTERFACE, `record --json`)."""
    import msgspec

    document: dict[str, Any] = msgspec.to_builtins(ended)
    del document["type"], document["remaining"]
    return {"run": document.pop("path")} | document


_DONE = ("rest", "enough", "duration", "stopped")


def _exit_by_ending(done: "list[RunEnded]", count: int) -> None:
    """End the command with the code that the end of the last run asks for."""
    last = done[-1] if done else None
    if last is not None and last.ended not in (*_DONE, "interrupted"):
        kept = f" (kept in {last.path})" if last.path else ""
        raise CommandError(f"{last.message or f'the run ended: {last.ended}'}{kept}")
    if last is None or last.ended == "interrupted" or len(done) < count:
        raise typer.Exit(130)
