"""Options of commands about devices, ports, gauges and calibrations."""

import datetime
from dataclasses import dataclass
from pathlib import Path

from app.cli import shared_options as shared
from app.cli.options import REQUIRED, argument, choice, flag, number, option
from app.cli.shared_options import DeviceOptions, LinkOptions
from config.schema import FILTER_KINDS
from drivers.registry import AVAILABLE


@dataclass(frozen=True, kw_only=True)
class ListDevicesOptions:
    """List the protocols, and what each was verified against."""

    as_json: bool = shared.as_json()


@dataclass(frozen=True, kw_only=True)
class ListPortsOptions:
    """List the serial ports of this computer."""

    as_json: bool = shared.as_json()


@dataclass(frozen=True, kw_only=True)
class ProbeOptions:
    """Recognise the devices on ports.

    Shows how to record from each, what is plugged in, and which program has it open.
    """

    ports: list[str] | None = argument("Ports or URLs; all serial ports if absent.", None, metavar="PORT")
    write: bool = flag("--write", "Send an identity query to silent devices; else nothing is sent.")
    as_json: bool = shared.as_json()


@dataclass(frozen=True, kw_only=True)
class StandOptions:
    """Options of the simulated stand, by the fields of `SimulatedStandOptions`."""

    protocol: str = option(
        "--protocol", f"{', '.join(driver.name for driver in AVAILABLE)}.", "slipstand-binary"
    )
    rate_hz: float | None = option("--rate", "Samples a second; as the protocol's device if absent.")
    series: str = option("--series", "Series code; brings T, n1, f_d, masses, pullback.", "1FFM0")
    friction: float | None = option("--friction", "True f_d; the series' if absent.")
    static_friction: float | None = option("--static-friction", "True f_s; f_d if absent.")
    tilt_rad: float = option("--tilt", "Tilt of the sliding plane (rad).", 0.0)
    effects: list[str] | None = shared.effects()
    pullback_m: float | None = option(
        "--pullback", "Pullback (m), negative to the other side; the series' if absent."
    )
    noise_m: float = option("--noise", "Noise of both gauges, standard deviation (m).", 2e-05)
    table_drift_m_per_s: float = option("--table-drift", "Drift of gauge 1 (m/s).", 0.0)
    relative_drift_m_per_s: float = option("--relative-drift", "Drift of gauge 2 (m/s).", 0.0)
    nonlinearity_m: float = option("--nonlinearity", "Largest deviation from the gauges' lines (m).", 0.0)
    table_clip_m: float | None = option("--table-clip", "Clip gauge 1 beyond this (m); never if absent.")
    relative_clip_m: float | None = option(
        "--relative-clip", "Clip gauge 2 beyond this (m); never if absent."
    )
    clock_ppm: float = option("--clock-ppm", "How much the device's clock is fast (ppm).", 0.0)
    gauge: str | None = choice(
        "--gauge", ("table", "relative"), "The only gauge (csv, enod4, gsv-234, hbm-aed, modbus)."
    )
    lag_s: float = option("--lag", "How much older its readings are than they seem (s).", 0.0)
    rate_error: float = option("--rate-error", "Sample faster than stated, by this fraction.", 0.0)
    first_sequence: int = option("--first-sequence", "Number of sample 0; wraps at 2**32.", 0)
    first_time_s: float = option("--first-time", "Device's time at sample 0 (s).", 0.0)
    rest_s: float = option("--rest", "Seconds at rest before the pull.", 1.0)
    pull_s: float = option("--pull", "Seconds of pulling back.", 2.0)
    hold_s: float = option("--hold", "Seconds of holding.", 1.5)
    decay_s: float = option("--decay", "Seconds of motion after release.", 20.0)
    recentre_s: float = option("--recentre", "Seconds of putting the plate back.", 1.0)
    every_s: float | None = option("--every", "Seconds from one test to the next; no rest between if absent.")
    count: int | None = option("--count", "Tests before it rests for good; no end if absent.")
    recentre_every: int = option("--recentre-every", "Put the plate back after so many tests; 0 never.", 1)
    plate_offset_m: float = option("--plate-offset", "Position of the plate at first (m).", 0.0)
    on_demand: bool = flag("--on-demand", "Begin a test only when told `pull` (--control).")
    early_release_m: float | None = option(
        "--early-release", "Let the first test go too early, when pulled so far (m)."
    )
    drop: float = option("--drop", "Fraction of frames that lose a byte.", 0.0)
    flip: float = option("--flip", "Fraction of frames with a bit flipped.", 0.0)
    truncate: float = option("--truncate", "Fraction of frames cut short.", 0.0)
    disturbances: list[str] | None = option(
        "--fault",
        "stall|rubbish|unplug|power [SECONDS] [at S], jump SECONDS [at S]; repeatable.",
        metavar="WHAT",
    )
    start_at_unix_s: float | None = option(
        "--start-at", "Begin the motion then (s since 1970): several stands as one.", metavar="UNIX"
    )
    tcp_port: int | None = option("--tcp", "Listen on 127.0.0.1, no pseudo-terminal; 0: any.", metavar="PORT")
    seed: int | None = option("--seed", "Makes noise and faults repeatable; drawn anew if absent.")
    truth_file: Path | None = option("--truth", "Write the truth to this JSON file.")
    gauges_file: Path | None = shared.calibration()


@dataclass(frozen=True, kw_only=True)
class SimulateDeviceOptions:
    """Run a simulated stand on a port until interrupted.

    It does one pullback test after another, on a pseudo-terminal or TCP; what a series brings can be changed.
    """

    stand: StandOptions
    settings: list[str] | None = shared.device_settings()
    control: bool = flag("--control", "Read such faults from stdin, too, one a line; pull, early.")
    as_json: bool = shared.as_json()


@dataclass(frozen=True, kw_only=True)
class HealthOptions:
    """Grade both gauges at rest: noise, drift, hum, range.

    Each is good, doubtful or bad, with a remedy. Ends with 1 if one is bad.
    """

    source: DeviceOptions
    seconds: float = number("--seconds", "Measuring time in seconds; the stand must rest.", 5.0, above=0.0)
    calibration: Path | None = shared.calibration()
    figure: Path | None = shared.figure()
    as_json: bool = shared.as_json()


@dataclass(frozen=True, kw_only=True)
class ReadingOptions:
    """Where the readings come from: a file, or a device."""

    points: Path | None = option("--points", "CSV of readings: counts, dial_mm, perhaps direction and round.")
    port: str | None = option("--port", "Serial port or URL, to read the counts live.")
    protocol: str | None = option("--protocol", "Protocol name, with --port.")
    settle: float = number("--settle", "Seconds over which counts are averaged.", 1.0, above=0.0)


@dataclass(frozen=True, kw_only=True)
class CertificateOptions:
    """What is stated of dial gauge and calibration."""

    dial_resolution: float = number("--dial-resolution", "Resolution of the dial (mm).", 0.01, least=0.0)
    dial_uncertainty: float | None = number(
        "--dial-uncertainty", "Standard uncertainty of the dial gauge, of its certificate (mm).", least=0.0
    )
    reference: str | None = option("--reference", "Which dial gauge.")
    certificate: str = option("--certificate", "Its certificate.", "")
    serial_number: str | None = option("--serial-number", "Of the gauge calibrated.")
    gauge_range: float | None = number("--range", "Range of the gauge (mm).", above=0.0)
    filter: str | None = choice(
        "--filter", FILTER_KINDS, "Low-pass filter of the amplifier; as it was if absent."
    )
    filter_order: int = option("--filter-order", "Its order.", 1)
    filter_corner: float | None = option("--filter-corner", "Its corner, at -3 dB (Hz).")
    by: str = option("--by", "Who calibrates.", "")
    valid_until: datetime.datetime | None = option(
        "--valid-until", "Last day on which it holds.", formats=["%Y-%m-%d"]
    )


@dataclass(frozen=True, kw_only=True)
class CalibrateOptions:
    """Calibrate a gauge against a dial: live, or from a file.

    Live, the device gives the counts, and the dial is typed in at each step.
    Take the table up and down in even steps, twice or more. Without --use give the file to `record
    --calibration`.
    """

    gauge: str | None = choice("--gauge", ("table", "relative"), "table (gauge 1) or relative (gauge 2).")
    source: ReadingOptions
    link: LinkOptions
    degree: int = option("--degree", "1 for a line, 2 or 3 for a polynomial.", 1)
    certificate: CertificateOptions
    calibration: Path | None = shared.calibration()
    output: Path | None = option("-o --output", "A new file; a dated one beside gauges.toml if absent.")
    use: bool = flag("--use", "Make it gauges.toml; the one before is kept.")
    figure: Path | None = shared.figure()
    as_json: bool = shared.as_json()


@dataclass(frozen=True, kw_only=True)
class StepOptions:
    """The known step that the gauge is checked with."""

    displacement: float | None = option("--displacement", "How far the gauge is moved, with its sign (mm).")
    shunt: float | None = option("--shunt", "Instead: what the shunt resistor stands for (mm).")
    shunt_counts: float | None = option("--shunt-counts", "Instead: the shunt's shift in counts.")
    uncertainty: float | None = number(
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

    gauge: str = shared.gauge(REQUIRED)
    source: DeviceOptions
    step: StepOptions
    seconds: float = number("--seconds", "Seconds over which counts are averaged.", 2.0, above=0.0)
    reference: str = option("--reference", "Which dial gauge, gauge block or resistor.", "")
    by: str = option("--by", "Who checks.", "")
    calibration: Path | None = shared.calibration()
    as_json: bool = shared.as_json()
