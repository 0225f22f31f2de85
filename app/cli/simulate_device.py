"""`slipstand device simulate`: the simulated stand on a port."""

import dataclasses
import sys
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer

from app.cli import output as out
from app.cli.errors import CommandError
from app.cli.options import CalibrationFile, DeviceSettings, Json, choice, key_values, with_options
from app.simulated_stand.client import Ready
from app.simulated_stand.options import SimulatedStandOptions
from app.simulated_stand.process import read_disturbances, serve, stop_on_signal_or_orphaned
from drivers.registry import AVAILABLE


@dataclasses.dataclass(frozen=True)
class StandOptions:
    """Options of the simulated stand, by the fields of `SimulatedStandOptions`."""

    protocol: Annotated[
        str, typer.Option("--protocol", help=f"{', '.join(driver.name for driver in AVAILABLE)}.")
    ] = "slipstand-binary"
    rate_hz: Annotated[float, typer.Option("--rate", help="Samples a second.")] = 2000.0
    series: Annotated[
        str, typer.Option("--series", help="Series code; brings T, n1, f_d, masses, pullback.")
    ] = "1FFM0"
    friction: Annotated[float | None, typer.Option("--friction", help="True f_d; the series' if absent.")] = (
        None
    )
    static_friction: Annotated[
        float | None, typer.Option("--static-friction", help="True f_s; f_d if absent.")
    ] = None
    tilt_rad: Annotated[float, typer.Option("--tilt", help="Tilt of the sliding plane (rad).")] = 0.0
    pullback_m: Annotated[
        float | None,
        typer.Option("--pullback", help="Pullback (m), negative to the other side; the series' if absent."),
    ] = None
    noise_m: Annotated[
        float, typer.Option("--noise", help="Noise of both gauges, standard deviation (m).")
    ] = 20e-6
    table_drift_m_per_s: Annotated[float, typer.Option("--table-drift", help="Drift of gauge 1 (m/s).")] = 0.0
    relative_drift_m_per_s: Annotated[
        float, typer.Option("--relative-drift", help="Drift of gauge 2 (m/s).")
    ] = 0.0
    nonlinearity_m: Annotated[
        float, typer.Option("--nonlinearity", help="Largest deviation from the gauges' lines (m).")
    ] = 0.0
    table_clip_m: Annotated[
        float | None, typer.Option("--table-clip", help="Clip gauge 1 beyond this (m); never if absent.")
    ] = None
    relative_clip_m: Annotated[
        float | None, typer.Option("--relative-clip", help="Clip gauge 2 beyond this (m); never if absent.")
    ] = None
    clock_ppm: Annotated[
        float, typer.Option("--clock-ppm", help="How much the device's clock is fast (ppm).")
    ] = 0.0
    gauge: Annotated[
        str | None,
        choice("--gauge", "table", "relative", help="The device's only gauge (csv, modbus); both if absent."),
    ] = None
    lag_s: Annotated[
        float, typer.Option("--lag", help="How much older its readings are than they seem (s).")
    ] = 0.0
    rate_error: Annotated[
        float, typer.Option("--rate-error", help="Sample faster than stated, by this fraction.")
    ] = 0.0
    first_sequence: Annotated[
        int, typer.Option("--first-sequence", help="Number of sample 0; wraps at 2**32.")
    ] = 0
    first_time_s: Annotated[float, typer.Option("--first-time", help="Device's time at sample 0 (s).")] = 0.0
    rest_s: Annotated[float, typer.Option("--rest", help="Seconds at rest before the pull.")] = 1.0
    pull_s: Annotated[float, typer.Option("--pull", help="Seconds of pulling back.")] = 2.0
    hold_s: Annotated[float, typer.Option("--hold", help="Seconds of holding.")] = 1.5
    decay_s: Annotated[float, typer.Option("--decay", help="Seconds of motion after release.")] = 20.0
    recentre_s: Annotated[float, typer.Option("--recentre", help="Seconds of putting the plate back.")] = 1.0
    every_s: Annotated[
        float | None,
        typer.Option("--every", help="Seconds from one test to the next; no rest between if absent."),
    ] = None
    count: Annotated[
        int | None, typer.Option("--count", help="Tests before it rests for good; no end if absent.")
    ] = None
    recentre_every: Annotated[
        int, typer.Option("--recentre-every", help="Put the plate back after so many tests; 0 never.")
    ] = 1
    plate_offset_m: Annotated[
        float, typer.Option("--plate-offset", help="Position of the plate at first (m).")
    ] = 0.0
    drop: Annotated[float, typer.Option("--drop", help="Fraction of frames that lose a byte.")] = 0.0
    flip: Annotated[float, typer.Option("--flip", help="Fraction of frames with a bit flipped.")] = 0.0
    truncate: Annotated[float, typer.Option("--truncate", help="Fraction of frames cut short.")] = 0.0
    disturbances: Annotated[
        list[str] | None,
        typer.Option(
            "--fault",
            metavar="WHAT",
            help="stall|rubbish|unplug|power [SECONDS] [at S], jump SECONDS [at S]; repeatable.",
        ),
    ] = None
    start_at_unix_s: Annotated[
        float | None,
        typer.Option(
            "--start-at",
            metavar="UNIX",
            help="Begin the motion then (s since 1970): several stands as one.",
        ),
    ] = None
    tcp_port: Annotated[
        int | None,
        typer.Option(
            "--tcp", metavar="PORT", help="Listen on 127.0.0.1 instead of a pseudo-terminal; 0: any."
        ),
    ] = None
    seed: Annotated[
        int | None, typer.Option("--seed", help="Makes noise and faults repeatable; drawn anew if absent.")
    ] = None
    truth_file: Annotated[Path | None, typer.Option("--truth", help="Write the truth to this JSON file.")] = (
        None
    )
    gauges_file: CalibrationFile = None

    def stand_options(self, settings: dict[str, str]) -> SimulatedStandOptions:
        """Return the options of the stand. Raises CommandError for a value out of range."""
        if self.truth_file is not None and not self.truth_file.expanduser().absolute().parent.is_dir():
            raise CommandError(
                f"--truth {self.truth_file}: there is no such folder. Make it first or choose another path"
            )
        values: dict[str, Any] = {name: _plain(value) for name, value in dataclasses.asdict(self).items()}
        values["disturbances"] = tuple(self.disturbances or ())
        try:
            return SimulatedStandOptions(**values, device=settings)
        except ValueError as error:
            raise CommandError(str(error)) from None


@with_options
def simulate_device(
    options: StandOptions,
    settings: DeviceSettings = None,
    control: Annotated[
        bool, typer.Option("--control", help="Take such faults as lines on stdin, too.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Be a simulated stand on a port until interrupted.

    It does one pullback test after another, on a pseudo-terminal or TCP; what a series brings can be changed.
    """
    _serve(options.stand_options(key_values(settings)), control, as_json)


def _plain(value: object) -> object:
    return str(value.expanduser().resolve()) if isinstance(value, Path) else value


def _serve(options: SimulatedStandOptions, control: bool, as_json: bool) -> None:
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
