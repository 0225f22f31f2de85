"""Options of commands that record, simulate or plan a test."""

from dataclasses import dataclass
from pathlib import Path

from app.cli import shared_options as shared
from app.cli.options import choice, flag, number, option
from app.cli.shared_options import ConditionOptions, DeviceOptions, JobOptions, MassOptions


@dataclass(frozen=True, kw_only=True)
class MotionOptions:
    """Parameters of a motion. A field that is None is taken from the series."""

    series: str | None = shared.series()
    pullback_m: float | None = number("--pullback", "Pullback (m); negative to the other side.")
    table_mass_kg: float | None = shared.table_mass()
    plate_mass_kg: float | None = shared.plate_mass()
    period_s: float | None = number("--period", "Damped period of the joint motion (s).", above=0.0)
    stiffness_n_per_m: float | None = number(
        "--stiffness", "Stiffness of the elastic plates (N/m).", above=0.0
    )
    damping_n1_per_s: float | None = number("--n1", "Damping constant of the joint motion (1/s).", least=0.0)
    damping_coefficient_kg_per_s: float | None = number("--damping", "Damping coefficient (kg/s).", least=0.0)
    friction_dynamic: float | None = number("--friction", "Dynamic friction coefficient f_d.", least=0.0)
    friction_static: float | None = number(
        "--static-friction", "Static friction f_s; f_d if absent.", least=0.0
    )
    tilt_rad: float = number("--tilt", "Tilt of the sliding plane (rad).", 0.0)


@dataclass(frozen=True, kw_only=True)
class DemoOptions:
    """Record a simulated pullback, and compare it with the truth.

    The simulated stand is read over a real serial port; the run is kept, identified and drawn.

    With --campaign the 36 series of Table 1 are simulated, read by gauges with errors as calibrated, and
    stored as runs; their table is compared with the truth.
    """

    series: str | None = option("--series", "Series code; with --campaign several, 1FFM0,1FFM1.")
    friction: float | None = number("--friction", "True f_d; the series' if absent.", above=0.0)
    directory: Path | None = shared.directory()
    campaign: bool = flag("--campaign", "All series of Table 1, several tests each, not in real time.")
    effects: list[str] | None = shared.effects()
    repeats: int = option("--repeats", "With --campaign: tests of each series.", 3)
    friction_scatter: float = option(
        "--scatter", "With --campaign: standard deviation of f_d from run to run, as a share.", 0.0
    )
    seed: int = option("--seed", "With --campaign: seed of the random numbers.", 1)
    jobs: JobOptions
    as_json: bool = shared.as_json()


@dataclass(frozen=True, kw_only=True)
class RecordOptions:
    """Record a pullback test from a device into a run file.

    Ctrl-C ends the run and keeps it. With --count the next run arms itself when one is stored, without the
    keyboard.
    """

    source: DeviceOptions
    masses: MassOptions
    pullback: float | None = number("--pullback", "Pullback (m), if not the series'.", above=0.0)
    tolerance: float | None = number(
        "--tolerance", "How far off the pullback it may be held (m); 2 % of it if absent.", above=0.0
    )
    duration: float | None = number(
        "--duration", "Seconds after release, or from the start with --trigger none.", above=0.0
    )
    until_rest: bool = flag("--until-rest", "End at rest or when enough; the default without --duration.")
    trigger: str = choice(
        "--trigger", ("pullback", "none"), "pullback, or none to record at once.", "pullback"
    )
    pretrigger: float = option("--pretrigger", "Seconds kept from before the release.", 1.0)
    trigger_timeout: float = number("--trigger-timeout", "Seconds to wait for a release.", 600.0, above=0.0)
    calibration: Path | None = shared.calibration()
    directory: Path | None = shared.directory()
    operator: str = option("--operator", "Who records.", "")
    note: str = option("--note", "A remark kept with the run.", "")
    conditions: ConditionOptions
    count: int = option("--count", "How many runs, one after another.", 1, min=1)
    as_json: bool = shared.as_json()


@dataclass(frozen=True, kw_only=True)
class SimulateOptions:
    """Simulate one pullback test: numbers, a CSV file or a run.

    Give a series, or pullback, both masses, period or stiffness, n1 or damping, and friction.
    Options override the values of the series.
    """

    motion: MotionOptions
    effects: list[str] | None = shared.effects()
    duration: float = number("--duration", "Seconds after release.", 10.0, above=0.0)
    rate: float = number("--rate", "Samples a second.", 1000.0, above=0.0)
    method: str = choice(
        "--method", ("exact", "paper"), "exact, or paper for its three-state algorithm.", "exact"
    )
    step: float = number("--step", "Time step of --method paper (s).", 0.0001, above=0.0)
    output: Path | None = option(
        "-o --output", "FILE.csv of the motion, or FILE.h5, a run; numbers are shown if absent."
    )
    force: bool = shared.force()
    as_json: bool = shared.as_json()


@dataclass(frozen=True, kw_only=True)
class PlanOptions:
    """Predict what a test will show, before it is made.

    Shows motion, u_s, use of the gauges' ranges, the uncertainty of f_d, and what would halve it.
    Effects that the stand shows in its last runs are planned with.
    Give a series, or pullback, both masses, period or stiffness, n1 or damping, and friction.
    Options override the values of the series.
    """

    motion: MotionOptions
    rate: float = number("--rate", "Samples a second.", 1000.0, above=0.0)
    noise: float = number(
        "--noise", "Standard deviation of both gauges' readings (m); see `device health`.", 2e-05, above=0.0
    )
    duration: float = number("--duration", "Seconds after release that are recorded.", 10.0, above=0.0)
    calibration: Path | None = shared.calibration()
    last_runs: Path | None = option(
        "--last-runs",
        "Folder of runs whose kept results tell the stand's effects; that of recordings if absent.",
        metavar="FOLDER",
    )
    ideal_stand: bool = flag("--ideal-stand", "Leave out what the last runs show of the stand.")
    as_json: bool = shared.as_json()
