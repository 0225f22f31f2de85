"""The exact motion against Siconos, a solver of non-smooth mechanics that is not ours.

The stand as a non-smooth dynamical system: three coordinates (table, plate along the plane, plate across
it), one contact with Coulomb friction, stepped by Moreau and Jean's scheme, which knows no events. It knows
no f_s above f_d either. Two commands, for two Pythons:

- `python3 benchmarks/siconos_check.py`, with a Python that has Siconos (Debian: apt-get install
  python3-siconos, then /usr/bin/python3), makes the trajectories in tests/analysis/data anew: 3 minutes;
- `python -m benchmarks.siconos_check --compare` prints how far each step size is from the exact solver.
"""

import argparse
import csv
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "tests" / "analysis" / "data"
TILTS_RAD = {"1FFM0": 0.0, "2SSM1": 1.5e-3}
PULLBACKS_M = {"1": 0.012, "2": 0.009, "3": 0.006}
STEPS_S = (1e-4, 2e-5, 5e-6)
DURATION_S, INTERVAL_S = 8.0, 4e-3
TABLE_MASS_KG, GRAVITY = 131.6, 9.81


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--compare", action="store_true", help="compare what is stored with the exact solver")
    if parser.parse_args().compare:
        compare()
    else:
        make()


def make() -> None:
    for series, tilt in TILTS_RAD.items():
        runs = [march(row_of(series), tilt, step) for step in STEPS_S]
        times = INTERVAL_S * np.arange(len(runs[0]))
        columns = np.column_stack([times, *(1e6 * run for run in runs)])
        names = [f"{name}_um_at_{step:g}_s" for step in STEPS_S for name in ("table", "relative")]
        target = DATA / f"siconos_{series}.csv"
        np.savetxt(
            target, columns, ["%.3f", *["%.4f"] * (2 * len(STEPS_S))], ",",
            header=",".join(["time_s", *names]), comments="",
        )  # fmt: skip
        print(f"{target.relative_to(ROOT)}: {len(times)} rows", file=sys.stderr)


def row_of(series: str) -> dict[str, float]:
    """The row of Table 1 with the pullback of the series."""
    with (ROOT / "config" / "table1.csv").open(newline="") as lines:
        row = next(row for row in csv.DictReader(lines) if row["series"] == series)
    names = ("period_s", "damping_n1_per_s", "plate_mass_kg", "friction_dynamic")
    return {name: float(row[name]) for name in names} | {"pullback_m": PULLBACKS_M[series[0]]}


def march(row: dict[str, float], tilt_rad: float, step_s: float) -> np.ndarray:
    """u1 and u2 - u1 (n, 2) at every `INTERVAL_S` by Siconos."""
    from siconos import kernel

    plate, joint = row["plate_mass_kg"], TABLE_MASS_KG + row["plate_mass_kg"]
    n1 = row["damping_n1_per_s"]
    stiffness = ((2.0 * math.pi / row["period_s"]) ** 2 + n1**2) * joint
    stand = kernel.LagrangianLinearTIDS(
        [row["pullback_m"], row["pullback_m"], 0.0], [0.0, 0.0, 0.0], np.diag([TABLE_MASS_KG, plate, plate]),
        np.diag([stiffness, 0.0, 0.0]), np.diag([2.0 * n1 * joint, 0.0, 0.0]),
    )  # fmt: skip
    # The table's displacement counts from its rest, where the plate's weight pulls it down the tilt.
    slope = plate * GRAVITY * tilt_rad
    stand.setFExtPtr([-slope, slope, -plate * GRAVITY])
    contact = kernel.Interaction(
        kernel.NewtonImpactFrictionNSL(0.0, 0.0, row["friction_dynamic"], 2),
        kernel.LagrangianLinearTIR(np.array([[0.0, 0.0, 1.0], [-1.0, 1.0, 0.0]]), [0.0, 0.0]),
    )
    model = kernel.NonSmoothDynamicalSystem(0.0, 2.0 * DURATION_S)
    model.insertDynamicalSystem(stand)
    model.link(contact, stand)
    solver = kernel.FrictionContact(2)
    solver.numericsSolverOptions().dparam[0] = 1e-13
    stepping = kernel.TimeStepping(
        model, kernel.TimeDiscretisation(0.0, step_s), kernel.MoreauJeanOSI(0.5), solver
    )
    return followed(stand, stepping, round(INTERVAL_S / step_s))


def followed(stand: Any, stepping: Any, steps: int) -> np.ndarray:
    """Every so many steps, u1 and u2 - u1."""
    states = []
    for k in range(round(DURATION_S / INTERVAL_S) * steps + 1):
        if k % steps == 0:
            table, plate, _ = stand.q()
            states.append((table, plate - table))
        stepping.computeOneStep()
        stepping.nextStep()
    return np.array(states)


def compare() -> None:
    print("| | step of Siconos | u1: largest difference, um | u2 - u1: largest difference, um |")
    print("|---|---|---|---|")
    for series, tilt in TILTS_RAD.items():
        time_s, runs = stored(series)
        exact = np.array(exact_motion(series, tilt, time_s))
        for step, run in zip(STEPS_S, runs, strict=True):
            table, relative = 1e6 * np.abs(run - exact).max(axis=1)
            print(f"| {series}, tilt {1e3 * tilt:g} mrad | {step:g} s | {table:.2g} | {relative:.2g} |")


def stored(series: str) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,), and u1 and u2 - u1 (m) by step size, (3, 2, n)."""
    columns = np.loadtxt(DATA / f"siconos_{series}.csv", delimiter=",", skiprows=1).T
    return columns[0], 1e-6 * columns[1:].reshape(len(STEPS_S), 2, -1)


def exact_motion(series: str, tilt_rad: float, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """u1 and u2 - u1 (n,) by the exact solver."""
    from analysis.motion.two_mass import TwoMassParameters

    parameters = TwoMassParameters.from_free_decay(
        table_mass_kg=TABLE_MASS_KG, tilt_rad=tilt_rad, gravity_m_per_s2=GRAVITY, **row_of(series)
    )
    return parameters.simulate(DURATION_S + 1e-3).sample_displacements(time_s)


if __name__ == "__main__":
    main()
