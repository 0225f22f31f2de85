"""`slipstand record`: record one run, or several, from a device."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.errors import CommandError
from app.cli.options import (
    DeviceSettings,
    Directory,
    Json,
    PlateMass,
    SeriesCode,
    TableMass,
    key_values,
    positive,
)

if TYPE_CHECKING:
    from app.acquisition.messages import Event, PortSettings, RunEnded, RunSettings


def record(
    port: Annotated[str, typer.Option(help="Serial port or URL: /dev/ttyUSB0, COM3, socket://host:port.")],
    protocol: Annotated[str, typer.Option(help="Protocol name, see `slipstand device list`.")],
    series: SeriesCode = None,
    plate_mass: PlateMass = None,
    table_mass: TableMass = None,
    rate: Annotated[float | None, typer.Option(help="Samples a second to ask of the device.")] = None,
    baud: Annotated[int | None, typer.Option(help="Baud rate; the protocol's usual one if absent.")] = None,
    parity: Annotated[str, typer.Option(help="N, E or O.")] = "N",
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
    count: Annotated[int, typer.Option(min=1, help="How many runs, one after another.")] = 1,
    settings: DeviceSettings = None,
    as_json: Json = False,
) -> None:
    """Record a pullback test from a device; Ctrl-C ends the run and keeps it."""
    from app.acquisition.messages import PortSettings, RunSettings
    from app.runs.places import recordings_directory
    from config.files import load_stand

    if until_rest and duration is not None:
        raise CommandError("--duration and --until-rest exclude each other. Give one of them")
    for name, value in (("--duration", duration), ("--rate", rate), ("--trigger-timeout", trigger_timeout)):
        positive(name, value)
    if not 0.0 <= pretrigger < float("inf"):
        raise CommandError(f"--pretrigger {pretrigger:g} must be a finite number, 0 or above")
    if parity not in ("N", "E", "O"):
        raise CommandError(f"--parity {parity!r} is not known. Use N, E or O")
    if trigger not in ("pullback", "none"):
        raise CommandError(f"--trigger {trigger!r} is not known. Use pullback or none")
    if trigger == "none" and duration is None:
        raise CommandError("--trigger none has no rest to wait for. Add --duration")
    if series is not None:
        series = load_stand().series(series).code  # a wrong code is told before any port is opened
    ports = PortSettings(
        url=port, protocol=protocol, baud=baud, parity=parity, rate_hz=rate, device=key_values(settings)
    )
    run = RunSettings(
        directory=str(directory.expanduser().resolve() if directory else recordings_directory()),
        series=series, plate_mass_kg=plate_mass, table_mass_kg=table_mass, trigger=trigger,
        pretrigger_s=pretrigger, duration_s=duration, trigger_timeout_s=trigger_timeout,
        operator=operator, note=note,
    )  # fmt: skip
    _record(ports, run, calibration, count, as_json)


def _record(
    port: "PortSettings", run: "RunSettings", calibration: Path | None, count: int, as_json: bool
) -> None:
    from app.cli import output as out
    from app.cli.unfinished import tell_unfinished

    tell_unfinished(Path(run.directory))
    ended = []
    for number in range(1, count + 1):
        if count > 1:
            out.tell(f"run {number} of {count}")
        ended.append(record_one(port, run, calibration))
        if ended[-1].ended not in _DONE:
            break
    if as_json:
        documents = [describe(one) for one in ended]
        out.emit_json(documents if count > 1 else documents[0])
    else:
        for one in ended:
            out.say(f"{one.path}: {one.samples} samples, ended: {one.ended}")
    _exit_as(ended[-1])


_DONE = ("rest", "enough", "duration", "stopped")


def record_one(port: "PortSettings", run: "RunSettings", calibration: Path | None = None) -> "RunEnded":
    """Record one run through the engine, telling its states and what is known so far on stderr."""
    from app.acquisition.client import record_run
    from app.cli.live_line import LiveLine
    from config.files import settings_file

    gauges_file = calibration.expanduser().resolve() if calibration else settings_file("gauges.toml")
    with LiveLine() as line:

        def hear(event: "Event") -> None:
            _tell(event)
            line.hear(event)

        return record_run(port, run, str(settings_file("stand.toml")), str(gauges_file), hear)


def describe(ended: "RunEnded") -> dict[str, Any]:
    """JSON object of one recorded run (INTERFACE, `record --json`)."""
    import msgspec

    document: dict[str, Any] = msgspec.to_builtins(ended)
    document.pop("type", None)
    return {"run": document.pop("path")} | document


_SENTENCES = {
    "zero": "Leave the table at rest: its zero is measured.",
    "pulling": "Pulling: go on to the pullback and hold.",
    "held": "Held and steady: let go.",
    "slipping": "Released: the plate slides.",
    "tail": "Both plates swing together.",
    "closing": "Closing the run file.",
}


def _tell(event: "Event") -> None:
    from app.acquisition.messages import Connected, Reconnected, Reconnecting, RunStarted, StateChanged
    from app.cli import output as out

    if isinstance(event, Connected):
        out.tell(f"connected: {event.device} {event.firmware}, {event.rate_hz:g} Hz")
    elif isinstance(event, RunStarted):
        out.tell(f"recording {event.path}")
    elif isinstance(event, Reconnecting | Reconnected):
        out.tell(event.message)
    elif isinstance(event, StateChanged) and event.state in _SENTENCES:
        out.tell(_SENTENCES[event.state])


def _exit_as(ended: "RunEnded") -> None:
    """End the command with the code that the run's end asks for."""
    if ended.ended == "interrupted":
        raise typer.Exit(130)
    if ended.ended not in _DONE:
        raise CommandError(f"{ended.message or f'the run ended: {ended.ended}'} (kept in {ended.path})")
