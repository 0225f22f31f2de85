"""Tests before they are made, simulated or planned, and the calibration of gauges."""

from collections.abc import Iterator
from dataclasses import dataclass
from html import escape

from numpy.typing import ArrayLike

from analysis.calibration.calibrate import Calibration, DialGauge
from analysis.calibration.calibrate import calibrate as calibrate_points
from analysis.calibration.points import CalibrationPoints
from analysis.catalogue import MILLIMETRE, Place, definition
from analysis.motion.two_mass import Motion, TwoMassParameters
from analysis.plan import Plan
from analysis.plan import plan as plan_test
from analysis.record import Record
from analysis.synthetic import Truth, simulate_record
from app.runs.plan_json import build_planned_test
from app.simulated_stand.series_motion import resolve_motion
from config.files import load_gauges, load_stand

HOLD_S = 1.0
"""Of a simulated record, before the release."""


@dataclass(frozen=True, eq=False, slots=True)
class SimulatedTest:
    """A test of known truth."""

    parameters: TwoMassParameters
    motion: Motion
    """Exact, from the release on: `sample` gives displacements, velocities and accelerations at any times."""
    record: Record
    """As gauges with noise read it, released after a hold of 1 s."""


@dataclass(frozen=True, eq=False, repr=False)
class TestPlan:
    """What a test will show."""

    __test__ = False  # no test class of pytest
    plan: Plan
    """Motion, gauge ranges in use, expected quantities with budget, warnings."""

    def _rows(self) -> Iterator[tuple[str, str]]:
        motion = self.plan.motion
        yield "residual displacement", MILLIMETRE.text(motion.residual_displacement_m, 2)
        yield "slip ends", f"{motion.slip_end_s:.2f} s after the release"
        for name, use in (("gauge 1", self.plan.table_use), ("gauge 2", self.plan.relative_use)):
            yield name, f"{MILLIMETRE.number(use.lowest_m, 2)} to {MILLIMETRE.text(use.highest_m, 2)}"
        for name, quantity in self.plan.results.items():
            row = definition(name)
            yield f"{row.symbol.text} to expect", str(row.format(quantity, Place.TERMINAL))

    def __str__(self) -> str:
        lines = [f"{name:<21}  {value}" for name, value in self._rows()]
        return "\n".join([*lines, *(f"warning {one.code}: {one.message}" for one in self.plan.warnings)])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        rows = (f"<tr><td>{escape(name)}</td><td>{escape(value)}</td></tr>" for name, value in self._rows())
        return f"<table>{''.join(rows)}</table>"


def simulate(
    series: str | None = None,
    *,
    duration_s: float = 10.0,
    rate_hz: float = 1000.0,
    noise_m: float = 2e-5,
    seed: int = 0,
    **values: float,
) -> SimulatedTest:
    """Simulate a pullback test of a series of Table 1, or of `values`, or of a series with other values.

    `values` are `pullback_m`, `table_mass_kg`, `plate_mass_kg`, `period_s` or `stiffness_n_per_m`,
    `damping_n1_per_s` or `damping_coefficient_kg_per_s`, `friction_dynamic`, and as wanted `friction_static`,
    `tilt_rad`, `gravity_m_per_s2`. `noise_m` is the standard deviation of both gauges' white noise. Raises
    AnalysisError, MessageError.
    """
    parameters = resolve_motion(series, values)
    motion = parameters.simulate(duration_s)
    truth = Truth(
        plate_mass_kg=parameters.plate_mass_kg,
        pullback_m=parameters.pullback_m,
        rate_hz=rate_hz,
        duration_s=duration_s,
        hold_s=HOLD_S,
        noise_m=noise_m,
        seed=seed,
    )
    record = simulate_record(truth, motion.sample_displacements, masses=parameters.masses)
    return SimulatedTest(parameters, motion, record)


def plan(
    series: str | None = None,
    *,
    rate_hz: float = 1000.0,
    duration_s: float = 10.0,
    noise_m: float = 2e-5,
    **values: float,
) -> TestPlan:
    """Plan a test on an ideal stand with the settings and calibration in use; `values` as for `simulate`.

    `slipstand plan` also counts what the stand shows in its last runs. Raises AnalysisError, MessageError.
    """
    test = build_planned_test(
        resolve_motion(series, values),
        load_stand(),
        load_gauges(),
        rate_hz=rate_hz, duration_s=duration_s, noise_m=noise_m,
    )  # fmt: skip
    return TestPlan(plan_test(test))


def calibrate(
    counts: ArrayLike, displacement_m: ArrayLike, *, dial: DialGauge | None = None, degree: int = 1
) -> Calibration:
    """Calibrate a gauge: counts (n,) at displacements (n,) of a dial gauge, in the order of the readings.

    `degree` 1 fits a line, 2 and 3 a polynomial. Raises AnalysisError.
    """
    return calibrate_points(CalibrationPoints.from_readings(counts, displacement_m), dial, degree)
