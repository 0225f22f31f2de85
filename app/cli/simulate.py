"""`slipstand simulate`: one simulated test as numbers, CSV or a run."""

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from analysis.catalogue import ACCELERATION, METRES_PER_SECOND, MILLIMETRE, Place, definition
from analysis.motion.paper_method import simulate as simulate_by_paper
from analysis.motion.two_mass import Motion, TwoMassParameters
from app.cli import output as out
from app.cli.errors import CommandError
from app.cli.measurement_options import SimulateOptions
from app.cli.motion_parameters import check_samples, motion_parameters
from app.runs.disk import atomic_write
from app.runs.simulated import write_simulated_run


def simulate(options: SimulateOptions) -> None:
    """Simulate one pullback test: numbers, a CSV file or a run."""
    check_samples(options.duration, options.rate)
    if options.output is not None and options.output.suffix not in (".csv", ".h5"):
        raise CommandError(f"-o {options.output.name} has no known ending. Use .csv or .h5")
    target = out.output_file(options.output, options.force) if options.output else None
    parameters = motion_parameters(options.motion)
    if target is not None and target.suffix == ".h5" and parameters.pullback_m == 0.0:
        raise CommandError("--pullback 0 makes no run: nothing moves. Give another pullback, or -o FILE.csv")
    if options.method == "paper":
        _check_step(options.step, parameters)
    simulated = _solve(parameters, options.duration, options.method, options.step)
    if target is not None:
        _store(target, simulated, parameters, options.motion.series, options.rate, replace=options.force)
        out.print_status(f"wrote {target}")
    document = _document(simulated, parameters, options.method, options.step)
    if options.as_json:
        out.print_json(document)
    elif target is None:
        _print_motion(document)


_STEPS_A_PERIOD = 20


def _solve(parameters: TwoMassParameters, duration_s: float, method: str, step_s: float) -> Motion:
    if method == "exact":
        return parameters.simulate(duration_s)

    return simulate_by_paper(parameters, duration_s=duration_s, step_s=step_s)


def _check_step(step_s: float, parameters: TwoMassParameters) -> None:
    """Refuse steps in which the table would swing through more than a twentieth of its period."""
    period_s = 2.0 * math.pi * math.sqrt(parameters.table_mass_kg / parameters.stiffness_n_per_m)
    if step_s > period_s / _STEPS_A_PERIOD:
        raise CommandError(
            f"--step {step_s:g} s is too coarse for a period of {period_s:.3g} s. Give"
            f" {period_s / _STEPS_A_PERIOD:.1g} s at most; the paper took 1e-4 s"
        )


def _document(motion: Motion, parameters: TwoMassParameters, method: str, step_s: float) -> dict[str, Any]:
    return {
        "residual_displacement_m": motion.residual_displacement_m,
        "slip_end_s": motion.slip_end_s,
        "phases": len(motion.phase_starts_s),
        "table_velocity_max_m_per_s": motion.table_velocity_max_m_per_s,
        "plate_velocity_max_m_per_s": motion.plate_velocity_max_m_per_s,
        "table_acceleration_max_m_per_s2": motion.table_acceleration_max_m_per_s2,
        "plate_acceleration_max_m_per_s2": motion.plate_acceleration_max_m_per_s2,
        "stiffness_n_per_m": parameters.stiffness_n_per_m,
        "damping_coefficient_kg_per_s": parameters.damping_coefficient_kg_per_s,
        "parameters": asdict(parameters)
        | {"friction_static": parameters.static_or_dynamic, "duration_s": motion.duration_s, "method": method}
        | ({"step_s": step_s} if method == "paper" else {}),
    }


def _store(
    path: Path,
    motion: Motion,
    parameters: TwoMassParameters,
    series: str | None,
    rate_hz: float,
    *,
    replace: bool,
) -> None:
    if path.suffix == ".csv":
        _write_csv(path, motion, rate_hz, replace=replace)
        return

    write_simulated_run(path, motion, parameters, series=series, rate_hz=rate_hz, replace=replace)


def _write_csv(path: Path, motion: Motion, rate_hz: float, *, replace: bool) -> None:
    times_s = np.arange(math.floor(motion.duration_s * rate_hz * (1 + 1e-12)) + 1) / rate_hz
    columns = motion.sample(times_s).columns()
    formats = ["%d" if name == "phase" else "%.17g" for name in columns]
    with atomic_write(path, replace=replace) as made, made.open("x", encoding="utf-8", newline="") as file:
        np.savetxt(
            file,
            np.column_stack(list(columns.values())),
            delimiter=",",
            header=",".join(columns),
            comments="",
            fmt=formats,
        )


def _print_motion(document: dict[str, Any]) -> None:
    out.print_line(f"residual displacement   {MILLIMETRE.text(document['residual_displacement_m'], 4)}")
    out.print_line(
        f"slip ends               {document['slip_end_s']:.4f} s after {document['phases']} phases"
    )
    for body in ("table", "plate"):
        velocity = METRES_PER_SECOND.text(document[f"{body}_velocity_max_m_per_s"], 4)
        acceleration = ACCELERATION.text(document[f"{body}_acceleration_max_m_per_s2"], 3)
        out.print_line(f"{body} at most          {velocity}, {acceleration}")
    for label, name, decimals in (
        ("stiffness c", "stiffness_n_per_m", 1),
        ("damping coefficient mu", "damping_coefficient_kg_per_s", 3),
    ):
        unit = definition(name).unit_at(Place.TERMINAL)
        out.print_line(f"{label:23} {unit.text(document[name], decimals)}")
