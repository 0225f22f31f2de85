"""What `slipstand simulate` does: the motion of one test, as numbers, CSV or a run."""

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from analysis.catalogue import MILLIMETRE, Place, definition
from analysis.motion.two_mass import PEAK_RATES, Motion, TwoMassParameters
from app.cli import output as out
from app.cli.errors import CommandError
from app.cli.measurement_options import SimulateOptions
from app.cli.motion_parameters import check_samples, largest_rates, motion_parameters
from app.cli.option_values import key_values
from app.runs.disk import atomic_write
from app.simulated_stand.effects import GAUGE_EFFECTS, gauge_values, motion_values, parse_effects
from app.simulated_stand.gauge_chain import GaugeChain
from app.simulated_stand.motion import simulate_stand


def simulate_test(options: SimulateOptions) -> None:
    check_samples(options.duration, options.rate)
    target = out.output_file(options.output, options.force, (".csv", ".h5")) if options.output else None
    parameters = motion_parameters(options.motion)
    effects = parse_effects(key_values(options.effects, "--effect"))
    if target is not None and target.suffix.lower() == ".h5" and parameters.pullback_m == 0.0:
        raise CommandError("--pullback 0 makes no run: nothing moves. Give another pullback, or -o FILE.csv")
    is_run = target is not None and target.suffix.lower() == ".h5"
    if (unread := [name for name in effects if name in GAUGE_EFFECTS]) and not is_run:
        raise CommandError(f"--effect {unread[0]} changes readings, which only a run holds. Give -o FILE.h5")
    if options.method == "paper":
        if effects:
            raise CommandError("--effect needs --method exact: the paper knows the ideal stand only")
        _check_step(options.step, parameters)
        from analysis.motion.paper_method import simulate as simulate_by_paper

        motion: Motion = simulate_by_paper(parameters, duration_s=options.duration, step_s=options.step)
    else:
        motion = simulate_stand(parameters, motion_values(effects), options.duration)
    if target is not None and target.suffix.lower() == ".csv":
        _write_csv(target, motion, options.rate, replace=options.force)
    elif target is not None:
        from app.runs.simulated import write_simulated_run  # and with it what reads and writes run files

        values = motion_values(effects), gauge_values(effects)
        chain = GaugeChain(values[1], parameters.pullback_m, options.rate)
        write_simulated_run(
            target, motion, parameters,
            series=options.motion.series, rate_hz=options.rate, replace=options.force,
            effects=values[0] | values[1], read=chain.read,
        )  # fmt: skip
    if target is not None:
        out.print_status(f"wrote {target}")
    document = _document(motion, parameters, options.method, options.step)
    document["parameters"] |= motion_values(effects) | gauge_values(effects)
    if options.as_json:
        out.print_json(document)
    elif target is None:
        _print_motion(document)


_STEPS_A_PERIOD = 20


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
        **{name: getattr(motion, name) for name in PEAK_RATES},
        "stiffness_n_per_m": parameters.stiffness_n_per_m,
        "damping_coefficient_kg_per_s": parameters.damping_coefficient_kg_per_s,
        "parameters": asdict(parameters)
        | {"friction_static": parameters.static_or_dynamic, "duration_s": motion.duration_s, "method": method}
        | ({"step_s": step_s} if method == "paper" else {}),
    }


def _write_csv(path: Path, motion: Motion, rate_hz: float, *, replace: bool) -> None:
    times_s = np.arange(math.floor(motion.duration_s * rate_hz * (1 + 1e-12)) + 1) / rate_hz
    columns = motion.sample(times_s).columns()
    formats = ["%d" if name == "phase" else "%.17g" for name in columns]
    with atomic_write(path, replace=replace) as made, made.open("x", encoding="utf-8", newline="") as file:
        rows = np.column_stack(list(columns.values()))
        np.savetxt(file, rows, formats, delimiter=",", header=",".join(columns), comments="")


def _print_motion(document: dict[str, Any]) -> None:
    slip_end = f"{document['slip_end_s']:.4f} s after {document['phases']} phases"
    rows = [
        ("residual displacement", MILLIMETRE.text(document["residual_displacement_m"], 4)),
        ("slip ends", slip_end),
        *largest_rates(document, 4),
    ]
    for label, name, decimals in (
        ("stiffness c", "stiffness_n_per_m", 1),
        ("damping coefficient mu", "damping_coefficient_kg_per_s", 3),
    ):
        rows.append((label, definition(name).unit_at(Place.TERMINAL).text(document[name], decimals)))
    out.print_fields(rows, 24)
