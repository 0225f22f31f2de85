"""Options of commands about devices, ports, gauges and calibrations."""

import datetime
from dataclasses import dataclass
from pathlib import Path

from app.cli import options as opt
from app.cli.options import DeviceOptions, LinkOptions
from drivers.registry import AVAILABLE


@dataclass(frozen=True, kw_only=True)
class ListDevicesOptions:
    """List the protocols, and what each was verified against."""

    as_json: bool = opt.as_json()


@dataclass(frozen=True, kw_only=True)
class ListPortsOptions:
    """List the serial ports of this computer."""

    as_json: bool = opt.as_json()


@dataclass(frozen=True, kw_only=True)
class ProbeOptions:
    """Look at ports: what speaks on them, how to record it.

    Also what is plugged in, and which program has it open.
    """

    ports: list[str] | None = opt.argument("Ports or URLs to look at; all serial ports if absent.", None)
    write: bool = opt.flag("--write", "Ask silent devices who they are. Without it nothing is sent to any.")
    as_json: bool = opt.as_json()


@dataclass(frozen=True, kw_only=True)
class StandOptions:
    """Options of the simulated stand, by the fields of `SimulatedStandOptions`."""

    protocol: str = opt.option(
        "--protocol", f"{', '.join(driver.name for driver in AVAILABLE)}.", "slipstand-binary"
    )
    rate_hz: float = opt.option("--rate", "Samples a second.", 2000.0)
    series: str = opt.option("--series", "Series code; brings T, n1, f_d, masses, pullback.", "1FFM0")
    friction: float | None = opt.option("--friction", "True f_d; the series' if absent.")
    static_friction: float | None = opt.option("--static-friction", "True f_s; f_d if absent.")
    tilt_rad: float = opt.option("--tilt", "Tilt of the sliding plane (rad).", 0.0)
    pullback_m: float | None = opt.option(
        "--pullback", "Pullback (m), negative to the other side; the series' if absent."
    )
    noise_m: float = opt.option("--noise", "Noise of both gauges, standard deviation (m).", 2e-05)
    table_drift_m_per_s: float = opt.option("--table-drift", "Drift of gauge 1 (m/s).", 0.0)
    relative_drift_m_per_s: float = opt.option("--relative-drift", "Drift of gauge 2 (m/s).", 0.0)
    nonlinearity_m: float = opt.option("--nonlinearity", "Largest deviation from the gauges' lines (m).", 0.0)
    table_clip_m: float | None = opt.option("--table-clip", "Clip gauge 1 beyond this (m); never if absent.")
    relative_clip_m: float | None = opt.option(
        "--relative-clip", "Clip gauge 2 beyond this (m); never if absent."
    )
    clock_ppm: float = opt.option("--clock-ppm", "How much the device's clock is fast (ppm).", 0.0)
    gauge: str | None = opt.choice(
        "--gauge", ("table", "relative"), "The device's only gauge (csv, modbus); both if absent."
    )
    lag_s: float = opt.option("--lag", "How much older its readings are than they seem (s).", 0.0)
    rate_error: float = opt.option("--rate-error", "Sample faster than stated, by this fraction.", 0.0)
    first_sequence: int = opt.option("--first-sequence", "Number of sample 0; wraps at 2**32.", 0)
    first_time_s: float = opt.option("--first-time", "Device's time at sample 0 (s).", 0.0)
    rest_s: float = opt.option("--rest", "Seconds at rest before the pull.", 1.0)
    pull_s: float = opt.option("--pull", "Seconds of pulling back.", 2.0)
    hold_s: float = opt.option("--hold", "Seconds of holding.", 1.5)
    decay_s: float = opt.option("--decay", "Seconds of motion after release.", 20.0)
    recentre_s: float = opt.option("--recentre", "Seconds of putting the plate back.", 1.0)
    every_s: float | None = opt.option(
        "--every", "Seconds from one test to the next; no rest between if absent."
    )
    count: int | None = opt.option("--count", "Tests before it rests for good; no end if absent.")
    recentre_every: int = opt.option(
        "--recentre-every", "Put the plate back after so many tests; 0 never.", 1
    )
    plate_offset_m: float = opt.option("--plate-offset", "Position of the plate at first (m).", 0.0)
    drop: float = opt.option("--drop", "Fraction of frames that lose a byte.", 0.0)
    flip: float = opt.option("--flip", "Fraction of frames with a bit flipped.", 0.0)
    truncate: float = opt.option("--truncate", "Fraction of frames cut short.", 0.0)
    disturbances: list[str] | None = opt.option(
        "--fault",
        "stall|rubbish|unplug|power [SECONDS] [at S], jump SECONDS [at S]; repeatable.",
        metavar="WHAT",
    )
    start_at_unix_s: float | None = opt.option(
        "--start-at", "Begin the motion then (s since 1970): several stands as one.", metavar="UNIX"
    )
    tcp_port: int | None = opt.option(
        "--tcp", "Listen on 127.0.0.1 instead of a pseudo-terminal; 0: any.", metavar="PORT"
    )
    seed: int | None = opt.option("--seed", "Makes noise and faults repeatable; drawn anew if absent.")
    truth_file: Path | None = opt.option("--truth", "Write the truth to this JSON file.")
    gauges_file: Path | None = opt.calibration()


@dataclass(frozen=True, kw_only=True)
class SimulateDeviceOptions:
    """Be a simulated stand on a port until interrupted.

    It does one pullback test after another, on a pseudo-terminal or TCP; what a series brings can be changed.
    """

    stand: StandOptions
    settings: list[str] | None = opt.device_settings()
    control: bool = opt.flag("--control", "Take such faults as lines on stdin, too.")
    as_json: bool = opt.as_json()


@dataclass(frozen=True, kw_only=True)
class HealthOptions:
    """Look at both gauges at rest: noise, drift, hum, range.

    Each is good, doubtful or bad, with what to do. Ends with 1 if one is bad.
    """

    source: DeviceOptions
    seconds: float = opt.number(
        "--seconds", "Seconds of watching; the stand rests meanwhile.", 5.0, above=0.0
    )
    calibration: Path | None = opt.calibration()
    figure: Path | None = opt.figure()
    as_json: bool = opt.as_json()


@dataclass(frozen=True, kw_only=True)
class ReadingOptions:
    """Where the readings come from: a file, or a device."""

    points: Path | None = opt.option(
        "--points", "CSV of readings: counts, dial_mm, perhaps direction and round."
    )
    port: str | None = opt.option("--port", "Serial port or URL, to read the counts live.")
    protocol: str | None = opt.option("--protocol", "Protocol name, with --port.")
    settle: float = opt.number("--settle", "Seconds over which counts are averaged.", 1.0, above=0.0)


@dataclass(frozen=True, kw_only=True)
class CertificateOptions:
    """What is stated of dial gauge and calibration."""

    dial_resolution: float = opt.number(
        "--dial-resolution", "Resolution of the dial readings (mm).", 0.01, least=0.0
    )
    dial_uncertainty: float | None = opt.number(
        "--dial-uncertainty", "Standard uncertainty of the dial gauge, of its certificate (mm).", least=0.0
    )
    reference: str | None = opt.option("--reference", "Which dial gauge.")
    certificate: str = opt.option("--certificate", "Its certificate.", "")
    serial_number: str | None = opt.option("--serial-number", "Of the gauge calibrated.")
    gauge_range: float | None = opt.number("--range", "Range of the gauge (mm).", above=0.0)
    by: str = opt.option("--by", "Who calibrates.", "")
    valid_until: datetime.datetime | None = opt.option(
        "--valid-until", "Last day on which it holds.", formats=["%Y-%m-%d"]
    )


@dataclass(frozen=True, kw_only=True)
class CalibrateOptions:
    """Calibrate a gauge against a dial: live, or from a file.

    Live, the device gives the counts, and the dial is typed in at each step.
    Take the table up and down in even steps, twice or more. Without --use give the file to `record
    --calibration`.
    """

    gauge: str | None = opt.choice("--gauge", ("table", "relative"), "table (gauge 1) or relative (gauge 2).")
    source: ReadingOptions
    link: LinkOptions
    degree: int = opt.option("--degree", "1 for a line, 2 or 3 for a polynomial.", 1)
    certificate: CertificateOptions
    calibration: Path | None = opt.calibration()
    output: Path | None = opt.option("-o --output", "A new file; a dated one beside gauges.toml if absent.")
    use: bool = opt.flag("--use", "Make it gauges.toml; the one before is kept.")
    figure: Path | None = opt.figure()
    as_json: bool = opt.as_json()


@dataclass(frozen=True, kw_only=True)
class StepOptions:
    """The known step that the gauge is checked with."""

    displacement: float | None = opt.option(
        "--displacement", "How far the gauge is moved, with its sign (mm)."
    )
    shunt: float | None = opt.option("--shunt", "Instead: what the shunt resistor stands for (mm).")
    shunt_counts: float | None = opt.option("--shunt-counts", "Instead: the shunt's shift in counts.")
    uncertainty: float | None = opt.number(
        "--uncertainty",
        "Standard uncertainty of what is known (mm, or counts with --shunt-counts).",
        least=0.0,
    )


@dataclass(frozen=True, kw_only=True)
class CheckOptions:
    """Check a gauge by a known displacement or its shunt.

    Before a test, move it so far, or switch its shunt resistor on.
    It passes if it is no further off than twice the combined standard uncertainty of calibration,
    displacement and readings. Ends with 1 if it does not; runs recorded later carry the verdict.
    """

    gauge: str = opt.gauge(opt.REQUIRED)
    source: DeviceOptions
    step: StepOptions
    seconds: float = opt.number("--seconds", "Seconds over which counts are averaged.", 2.0, above=0.0)
    reference: str = opt.option("--reference", "Which dial gauge, gauge block or resistor.", "")
    by: str = opt.option("--by", "Who checks.", "")
    calibration: Path | None = opt.calibration()
    as_json: bool = opt.as_json()
