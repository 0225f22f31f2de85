"""Options of commands that record, simulate or plan a test."""

import dataclasses
from pathlib import Path
from typing import Annotated

import typer

from app.cli.options import (
    CalibrationFile,
    ConditionOptions,
    DeviceOptions,
    Directory,
    Force,
    JobOptions,
    Json,
    MassOptions,
    PlateMass,
    SeriesCode,
    TableMass,
    choice,
    number,
)


@dataclasses.dataclass(frozen=True)
class MotionOptions:
    """Parameters of a motion. A field that is None is taken from the series."""

    series: SeriesCode = None
    pullback_m: Annotated[
        float | None, number("--pullback", help="Pullback (m); negative to the other side.")
    ] = None
    table_mass_kg: TableMass = None
    plate_mass_kg: PlateMass = None
    period_s: Annotated[
        float | None, number("--period", above=0.0, help="Damped period of the joint motion (s).")
    ] = None
    stiffness_n_per_m: Annotated[
        float | None, number("--stiffness", above=0.0, help="Stiffness of the elastic plates (N/m).")
    ] = None
    damping_n1_per_s: Annotated[
        float | None, number("--n1", least=0.0, help="Damping constant of the joint motion (1/s).")
    ] = None
    damping_coefficient_kg_per_s: Annotated[
        float | None, number("--damping", least=0.0, help="Damping coefficient (kg/s).")
    ] = None
    friction_dynamic: Annotated[
        float | None, number("--friction", least=0.0, help="Dynamic friction coefficient f_d.")
    ] = None
    friction_static: Annotated[
        float | None, number("--static-friction", least=0.0, help="Static friction f_s; f_d if absent.")
    ] = None
    tilt_rad: Annotated[float, number("--tilt", help="Tilt of the sliding plane (rad).")] = 0.0


@dataclasses.dataclass(frozen=True, kw_only=True)
class DemoOptions:
    """Record a simulated pullback, and compare it with the truth.

    The simulated stand is read over a real serial port; the run is kept, identified and drawn.

    With --campaign the 36 series of Table 1 are simulated, read by gauges that err as they state, and stored
    as runs; their table is held against the truth.
    """

    series: Annotated[
        str | None, typer.Option("--series", help="Series code; with --campaign several, 1FFM0,1FFM1.")
    ] = None
    friction: Annotated[
        float | None, number("--friction", above=0.0, help="True f_d; the series' if absent.")
    ] = None
    directory: Directory = None
    campaign: Annotated[
        bool, typer.Option("--campaign", help="All series of Table 1, each some times, not in real time.")
    ] = False
    repeats: Annotated[int, typer.Option(help="With --campaign: tests of each series.")] = 3
    scatter: Annotated[
        float, typer.Option(help="With --campaign: standard deviation of f_d from run to run, as a share.")
    ] = 0.0
    seed: Annotated[int, typer.Option(help="With --campaign: of everything that is drawn.")] = 1
    jobs: JobOptions
    as_json: Json = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class RecordOptions:
    """Record a pullback test from a device into a run file.

    Ctrl-C ends the run and keeps it. With --count the next run arms itself when one is stored, without the
    keyboard.
    """

    source: DeviceOptions
    masses: MassOptions
    pullback: Annotated[
        float | None, number("--pullback", above=0.0, help="Pullback (m), if not the series'.")
    ] = None
    tolerance: Annotated[
        float | None,
        number(
            "--tolerance", above=0.0, help="How far off the pullback it may be held (m); 2 % of it if absent."
        ),
    ] = None
    duration: Annotated[
        float | None,
        number("--duration", above=0.0, help="Seconds after release, or from the start with --trigger none."),
    ] = None
    until_rest: Annotated[
        bool, typer.Option("--until-rest", help="End at rest or when enough; the default without --duration.")
    ] = False
    trigger: Annotated[
        str, choice("--trigger", "pullback", "none", help="pullback, or none to record at once.")
    ] = "pullback"
    pretrigger: Annotated[float, typer.Option(help="Seconds kept from before the release.")] = 1.0
    trigger_timeout: Annotated[
        float, number("--trigger-timeout", above=0.0, help="Seconds to wait for a release.")
    ] = 600.0
    calibration: CalibrationFile = None
    directory: Directory = None
    operator: Annotated[str, typer.Option(help="Who records.")] = ""
    note: Annotated[str, typer.Option(help="A remark kept with the run.")] = ""
    conditions: ConditionOptions
    count: Annotated[int, typer.Option(min=1, help="How many runs, one after another.")] = 1
    as_json: Json = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class SimulateOptions:
    """Simulate one pullback test: numbers, a CSV file or a run.

    Give a series, or pullback, both masses, period or stiffness, n1 or damping, and friction.
    Options override the values of the series.
    """

    motion: MotionOptions
    duration: Annotated[float, number("--duration", above=0.0, help="Seconds after release.")] = 10.0
    rate: Annotated[float, number("--rate", above=0.0, help="Samples a second.")] = 1000.0
    method: Annotated[
        str, choice("--method", "exact", "paper", help="exact, or paper for its three-state algorithm.")
    ] = "exact"
    step: Annotated[float, number("--step", above=0.0, help="Time step of --method paper (s).")] = 1e-4
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="FILE.csv of the motion, or FILE.h5, a run; numbers are shown if absent."
        ),
    ] = None
    force: Force = False
    as_json: Json = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class PlanOptions:
    """Predict what a test will show, before it is made.

    Shows motion, u_s, use of the gauges' ranges, the uncertainty of f_d, and what would halve it.
    Give a series, or pullback, both masses, period or stiffness, n1 or damping, and friction.
    Options override the values of the series.
    """

    motion: MotionOptions
    rate: Annotated[float, number("--rate", above=0.0, help="Samples a second.")] = 1000.0
    noise: Annotated[
        float,
        number(
            "--noise",
            above=0.0,
            help="Standard deviation of both gauges' readings (m); see `device health`.",
        ),
    ] = 2e-5
    duration: Annotated[
        float, number("--duration", above=0.0, help="Seconds after release that are recorded.")
    ] = 10.0
    calibration: CalibrationFile = None
    as_json: Json = False
