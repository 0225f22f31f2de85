"""`slipstand device`: what can be talked to, and the simulated stand."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from app.cli.errors import CommandError
from app.cli.options import DeviceSettings, Json, key_values
from app.cli.probe import probe

if TYPE_CHECKING:
    from app.simulated_stand.options import SimulatedStandOptions

commands = typer.Typer(help="Devices, ports and the simulated stand.", no_args_is_help=True)


@commands.command("list")
def list_devices(as_json: Json = False) -> None:
    """List the protocols, and what each was verified against."""
    from app.cli import output as out
    from drivers.registry import PROTOCOLS

    rows = [
        {"protocol": p.name, "title": p.title, "default_baud": p.default_baud, "available": p.available,
         "verified": p.verified}
        for p in PROTOCOLS.values()
    ]  # fmt: skip
    if as_json:
        out.print_json(rows)
        return
    out.print_table(
        ("protocol", "device", "baud", "verified"),
        [(p.name, p.title, str(p.default_baud or ""), p.verified) for p in PROTOCOLS.values()],
    )


@commands.command("ports")
def list_ports(as_json: Json = False) -> None:
    """List the serial ports of this computer."""
    from dataclasses import asdict

    from app.cli import output as out
    from app.cli.probe import usb_identity
    from drivers.port import list_ports as present_ports
    from drivers.port_users import other_port_users
    from drivers.probe.host_checks import usb_chip_name

    ports = present_ports()
    if as_json:
        out.print_json([asdict(port) for port in ports])
    elif ports:
        rows = [
            (
                port.device,
                usb_chip_name(port.vendor_id, port.product_id) or port.description,
                usb_identity(port),
                ", ".join(map(str, other_port_users(port.device))),
            )
            for port in ports
        ]
        out.print_table(("port", "what it is", "identity", "in use by"), rows)
    else:
        out.print_line("No serial port found. Plug the amplifier in, or try: slipstand device simulate")


commands.command("probe")(probe)


@commands.command("simulate")
def simulate_device(
    protocol: Annotated[
        str, typer.Option(help="slipstand-binary, csv, gsv, harp or modbus.")
    ] = "slipstand-binary",
    rate: Annotated[float, typer.Option(help="Samples a second.")] = 2000.0,
    series: Annotated[str, typer.Option(help="Series code; brings T, n1, f_d, masses, pullback.")] = "1FFM0",
    friction: Annotated[float | None, typer.Option(help="True f_d; the series' if absent.")] = None,
    static_friction: Annotated[float | None, typer.Option(help="True f_s; f_d if absent.")] = None,
    tilt: Annotated[float, typer.Option(help="Tilt of the sliding plane (rad).")] = 0.0,
    pullback: Annotated[
        float | None, typer.Option(help="Pullback (m), negative to the other side; the series' if absent.")
    ] = None,
    noise: Annotated[float, typer.Option(help="Noise of both gauges, standard deviation (m).")] = 20e-6,
    table_drift: Annotated[float, typer.Option(help="Drift of gauge 1 (m/s).")] = 0.0,
    relative_drift: Annotated[float, typer.Option(help="Drift of gauge 2 (m/s).")] = 0.0,
    nonlinearity: Annotated[float, typer.Option(help="Largest deviation from the gauges' lines (m).")] = 0.0,
    table_clip: Annotated[
        float | None, typer.Option(help="Clip gauge 1 beyond this (m); never if absent.")
    ] = None,
    relative_clip: Annotated[
        float | None, typer.Option(help="Clip gauge 2 beyond this (m); never if absent.")
    ] = None,
    clock_ppm: Annotated[float, typer.Option(help="How much the device's clock is fast (ppm).")] = 0.0,
    gauge: Annotated[
        str | None, typer.Option(help="table or relative: the device's only gauge (csv, modbus).")
    ] = None,
    lag: Annotated[float, typer.Option(help="How much older its readings are than they seem (s).")] = 0.0,
    rate_error: Annotated[float, typer.Option(help="Sample faster than said, by this fraction.")] = 0.0,
    first_sequence: Annotated[int, typer.Option(help="Number of sample 0; wraps at 2**32.")] = 0,
    first_time: Annotated[float, typer.Option(help="Device's time at sample 0 (s).")] = 0.0,
    rest: Annotated[float, typer.Option(help="Seconds at rest before the pull.")] = 1.0,
    pull: Annotated[float, typer.Option(help="Seconds of pulling back.")] = 2.0,
    hold: Annotated[float, typer.Option(help="Seconds of holding.")] = 1.5,
    decay: Annotated[float, typer.Option(help="Seconds of motion after release.")] = 20.0,
    recentre: Annotated[float, typer.Option(help="Seconds of putting the plate back.")] = 1.0,
    every: Annotated[
        float | None, typer.Option(help="Seconds from one test to the next; no rest between if absent.")
    ] = None,
    count: Annotated[
        int | None, typer.Option(help="Tests before it rests for good; no end if absent.")
    ] = None,
    recentre_every: Annotated[int, typer.Option(help="Put the plate back after so many; 0 never.")] = 1,
    plate_offset: Annotated[float, typer.Option(help="Where the plate stands at first (m).")] = 0.0,
    drop: Annotated[float, typer.Option(help="Fraction of frames that lose a byte.")] = 0.0,
    flip: Annotated[float, typer.Option(help="Fraction of frames with a bit flipped.")] = 0.0,
    truncate: Annotated[float, typer.Option(help="Fraction of frames cut short.")] = 0.0,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            metavar="WHAT",
            help="stall|rubbish|unplug|power [SECONDS] [at S], jump SECONDS [at S]; repeatable.",
        ),
    ] = None,
    start_at: Annotated[
        float | None,
        typer.Option(metavar="UNIX", help="Begin the motion then (s since 1970): several stands as one."),
    ] = None,
    control: Annotated[
        bool, typer.Option("--control", help="Take such faults as lines on stdin, too.")
    ] = False,
    tcp: Annotated[
        int | None,
        typer.Option(metavar="PORT", help="Listen on 127.0.0.1 instead of a pseudo-terminal; 0: any."),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="Makes noise and faults repeatable; drawn anew if absent.")
    ] = None,
    truth: Annotated[Path | None, typer.Option(help="Write the truth to this JSON file.")] = None,
    calibration: Annotated[Path | None, typer.Option(help="Calibration file; gauges.toml if absent.")] = None,
    settings: DeviceSettings = None,
    as_json: Json = False,
) -> None:
    """Be a simulated stand on a port until interrupted.

    It does one pullback test after another, on a pseudo-terminal or TCP; what a series brings can be changed.
    """
    from app.simulated_stand.options import SimulatedStandOptions

    if truth is not None and not truth.expanduser().absolute().parent.is_dir():
        raise CommandError(f"--truth {truth}: there is no such folder. Make it first or choose another path")
    try:
        options = SimulatedStandOptions(
            protocol=protocol, rate_hz=rate, series=series, friction=friction,
            static_friction=static_friction, tilt_rad=tilt, pullback_m=pullback, noise_m=noise,
            table_drift_m_per_s=table_drift, relative_drift_m_per_s=relative_drift,
            nonlinearity_m=nonlinearity, clock_ppm=clock_ppm,
            rest_s=rest, pull_s=pull, hold_s=hold, decay_s=decay, recentre_s=recentre,
            every_s=every, count=count, recentre_every=recentre_every, plate_offset_m=plate_offset,
            table_clip_m=table_clip, relative_clip_m=relative_clip, rate_error=rate_error,
            first_sequence=first_sequence, first_time_s=first_time, tcp_port=tcp,
            start_at_unix_s=start_at, gauge=_gauge(gauge), lag_s=lag,
            drop=drop, flip=flip, truncate=truncate, disturbances=tuple(fault or ()),
            seed=seed, truth_file=_text(truth), gauges_file=_text(calibration), device=key_values(settings),
        )  # fmt: skip
    except ValueError as error:
        raise CommandError(str(error)) from None
    _serve(options, control, as_json)


def _serve(options: "SimulatedStandOptions", control: bool, as_json: bool) -> None:
    import sys

    import msgspec

    from app.cli import output as out
    from app.simulated_stand.client import Ready
    from app.simulated_stand.process import read_disturbances, serve, stop_on_signal_or_orphaned

    def announce(ready: Ready) -> None:
        if as_json:
            sys.stdout.write(msgspec.json.encode(ready).decode() + "\n")
        else:
            out.print_line(
                f"simulated stand {ready.series}, {ready.protocol}, {ready.rate_hz:g} Hz: {ready.port}"
            )
        sys.stdout.flush()

    if not as_json:
        out.print_status("starting; Ctrl-C ends it")
    orders = read_disturbances(lambda fault: out.print_status(f"error: {fault}")) if control else None
    ended = stop_on_signal_or_orphaned()
    if orders is None:
        serve(options, announce, ended)
    else:
        serve(options, announce, ended, next_disturbance=orders.take)


def _gauge(name: str | None) -> "Literal['table', 'relative'] | None":
    match name:
        case None:
            return None
        case "table":
            return "table"
        case "relative":
            return "relative"
    raise CommandError(f"--gauge {name!r} is not known. Use table or relative")


def _text(path: Path | None) -> str | None:
    return str(path.expanduser().resolve()) if path else None
