"""Options of commands about devices, ports, gauges and calibrations."""

import dataclasses
import datetime
from pathlib import Path
from typing import Annotated

import typer

from app.cli.options import (
    CalibrationFile,
    DeviceOptions,
    DeviceSettings,
    FigureFile,
    GaugeName,
    Json,
    LinkOptions,
    choice,
    number,
)
from drivers.registry import AVAILABLE


@dataclasses.dataclass(frozen=True, kw_only=True)
class ListDevicesOptions:
    """List the protocols, and what each was verified against."""

    as_json: Json = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class ListPortsOptions:
    """List the serial ports of this computer."""

    as_json: Json = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class ProbeOptions:
    """Look at ports: what speaks on them, how to record it.

    Also what is plugged in, and which program has it open.
    """

    ports: Annotated[
        list[str] | None, typer.Argument(help="Ports or URLs to look at; all serial ports if absent.")
    ] = None
    write: Annotated[
        bool,
        typer.Option("--write", help="Ask silent devices who they are. Without it nothing is sent to any."),
    ] = False
    as_json: Json = False


@dataclasses.dataclass(frozen=True, kw_only=True)
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


@dataclasses.dataclass(frozen=True, kw_only=True)
class SimulateDeviceOptions:
    """Be a simulated stand on a port until interrupted.

    It does one pullback test after another, on a pseudo-terminal or TCP; what a series brings can be changed.
    """

    stand: StandOptions
    settings: DeviceSettings = None
    control: Annotated[bool, typer.Option("--control", help="Take such faults as lines on stdin, too.")] = (
        False
    )
    as_json: Json = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class HealthOptions:
    """Look at both gauges at rest: noise, drift, hum, range.

    Each is good, doubtful or bad, with what to do. Ends with 1 if one is bad.
    """

    source: DeviceOptions
    seconds: Annotated[
        float, number("--seconds", above=0.0, help="Seconds of watching; the stand rests meanwhile.")
    ] = 5.0
    calibration: CalibrationFile = None
    figure: FigureFile = None
    as_json: Json = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class ReadingOptions:
    """Where the readings come from: a file, or a device."""

    points: Annotated[
        Path | None,
        typer.Option("--points", help="CSV of readings: counts, dial_mm, perhaps direction and round."),
    ] = None
    port: Annotated[
        str | None, typer.Option("--port", help="Serial port or URL, to read the counts live.")
    ] = None
    protocol: Annotated[str | None, typer.Option("--protocol", help="Protocol name, with --port.")] = None
    settle: Annotated[
        float, number("--settle", above=0.0, help="Seconds over which counts are averaged.")
    ] = 1.0


@dataclasses.dataclass(frozen=True, kw_only=True)
class CertificateOptions:
    """What is stated of dial gauge and calibration."""

    dial_resolution: Annotated[
        float, number("--dial-resolution", least=0.0, help="Resolution of the dial readings (mm).")
    ] = 0.01
    dial_uncertainty: Annotated[
        float | None,
        number(
            "--dial-uncertainty",
            least=0.0,
            help="Standard uncertainty of the dial gauge, of its certificate (mm).",
        ),
    ] = None
    reference: Annotated[str | None, typer.Option("--reference", help="Which dial gauge.")] = None
    certificate: Annotated[str, typer.Option("--certificate", help="Its certificate.")] = ""
    serial_number: Annotated[str | None, typer.Option("--serial-number", help="Of the gauge calibrated.")] = (
        None
    )
    gauge_range: Annotated[float | None, number("--range", above=0.0, help="Range of the gauge (mm).")] = None
    by: Annotated[str, typer.Option("--by", help="Who calibrates.")] = ""
    valid_until: Annotated[
        datetime.datetime | None,
        typer.Option("--valid-until", formats=["%Y-%m-%d"], help="Last day on which it holds."),
    ] = None


@dataclasses.dataclass(frozen=True, kw_only=True)
class CalibrateOptions:
    """Calibrate a gauge against a dial: live, or from a file.

    Live, the device gives the counts, and the dial is typed in at each step.
    Take the table up and down in even steps, twice or more. Without --use give the file to `record
    --calibration`.
    """

    gauge: Annotated[
        str | None, choice("--gauge", "table", "relative", help="table (gauge 1) or relative (gauge 2).")
    ] = None
    source: ReadingOptions
    link: LinkOptions
    degree: Annotated[int, typer.Option(help="1 for a line, 2 or 3 for a polynomial.")] = 1
    certificate: CertificateOptions
    calibration: CalibrationFile = None
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="A new file; a dated one beside gauges.toml if absent."),
    ] = None
    use: Annotated[bool, typer.Option("--use", help="Make it gauges.toml; the one before is kept.")] = False
    figure: FigureFile = None
    as_json: Json = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class StepOptions:
    """The known step that the gauge is checked with."""

    displacement: Annotated[
        float | None,
        typer.Option("--displacement", help="How far the gauge is moved, with its sign (mm)."),
    ] = None
    shunt: Annotated[
        float | None, typer.Option("--shunt", help="Instead: what the shunt resistor stands for (mm).")
    ] = None
    shunt_counts: Annotated[
        float | None, typer.Option("--shunt-counts", help="Instead: the shunt's shift in counts.")
    ] = None
    uncertainty: Annotated[
        float | None,
        number(
            "--uncertainty",
            least=0.0,
            help="Standard uncertainty of what is known (mm, or counts with --shunt-counts).",
        ),
    ] = None


@dataclasses.dataclass(frozen=True, kw_only=True)
class CheckOptions:
    """Check a gauge by a known displacement or its shunt.

    Before a test, move it so far, or switch its shunt resistor on.
    It passes if it is no further off than twice the combined standard uncertainty of calibration,
    displacement and readings. Ends with 1 if it does not; runs recorded later carry the verdict.
    """

    gauge: GaugeName
    source: DeviceOptions
    step: StepOptions
    seconds: Annotated[
        float, number("--seconds", above=0.0, help="Seconds over which counts are averaged.")
    ] = 2.0
    reference: Annotated[str, typer.Option(help="Which dial gauge, gauge block or resistor.")] = ""
    by: Annotated[str, typer.Option(help="Who checks.")] = ""
    calibration: CalibrationFile = None
    as_json: Json = False
