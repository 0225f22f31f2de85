"""Identify's work on a real run file: simulations as finely as drawn, other laws, classical figures."""

import numpy as np
import pytest

from analysis.motion.two_mass import TwoMassParameters
from app.presenters.analysed_run import AnalysisTask
from app.presenters.analysis_task import analyse_run, run_analysis
from app.presenters.base import Progress
from app.presenters.identify.state import Span
from app.presenters.identify.tasks import estimate_classical, simulate_friction
from app.runs.simulated import write_simulated_run

RATE_HZ, HELD_S, DURATION_S = 1000.0, 1.0, 8.0
PARAMETERS = TwoMassParameters.from_free_decay(
    period_s=0.32,
    damping_n1_per_s=0.12,
    table_mass_kg=131.6,
    plate_mass_kg=22.4,
    friction_dynamic=0.1,
    pullback_m=0.012,
)


def ignore(_progress: Progress) -> None:
    pass


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("runs") / "run.h5"
    write_simulated_run(path, PARAMETERS.simulate(DURATION_S), PARAMETERS, series="1FFM0", rate_hz=RATE_HZ)
    return str(path)


def test_a_run_is_simulated_by_hand_where_and_as_finely_as_it_is_drawn(path: str) -> None:
    run = analyse_run(path, ignore)
    friction = 0.104
    span = Span(0.5, 4.5, 300, HELD_S)
    hand = simulate_friction(AnalysisTask(path), friction, span)
    table, relative = hand.simulations
    assert len(table.time_s) <= 2.5 * span.pixels
    assert (table.time_s[0], table.time_s[-1]) == pytest.approx((span.start_s, span.end_s), abs=0.02)
    other = TwoMassParameters(
        **{name: getattr(PARAMETERS, name) for name in PARAMETERS.__dataclass_fields__}
        | {"friction_dynamic": friction}
    )
    truth = other.simulate(DURATION_S).sample(table.time_s)
    np.testing.assert_allclose(1e-3 * table.values, truth.table_displacement_m, atol=2e-6)
    np.testing.assert_allclose(1e-3 * relative.values, truth.relative_displacement_m, atol=2e-5)
    residual = hand.residuals_um[1]
    assert len(residual.time_s) <= span.pixels
    assert run.relative is not None
    time_s = run.time_s - HELD_S
    rows = (time_s >= span.start_s) & (time_s <= span.end_s)
    full = other.simulate(DURATION_S).sample(time_s[rows]).relative_displacement_m
    left_m = run.relative.record_m[rows] - full
    assert 1e-6 * residual.values.max() == pytest.approx(left_m.max(), abs=2e-5)
    assert 1e-6 * residual.values.min() == pytest.approx(left_m.min(), abs=2e-5)


def test_slips_are_those_of_the_motion(path: str) -> None:
    run = analyse_run(path, ignore)
    motion = PARAMETERS.simulate(DURATION_S)
    assert run.slips[0][0] == pytest.approx(HELD_S, abs=1e-4)
    assert run.slips[-1][1] == pytest.approx(HELD_S + motion.slip_end_s, abs=1e-3)
    assert all(one[1] < other[0] for one, other in zip(run.slips, run.slips[1:], strict=False))


def test_another_law_and_another_kind_are_analysed_and_kept(path: str) -> None:
    analyse_run(path, ignore)
    said: list[Progress] = []
    static = AnalysisTask(path, "static")
    found = run_analysis(static, said.append)
    assert found.model is not None
    assert found.model.name == "static"
    assert said
    said.clear()
    run_analysis(static, said.append)
    assert said == []
    assert found.results["friction_dynamic"].value == pytest.approx(0.1, abs=1e-4)
    one = run_analysis(AnalysisTask(path, kind="one-mass"), ignore)
    assert (one.kind, one.relative, one.kinematics, one.slips) == ("one-mass", None, None, ())
    assert one.table.fit_m is not None
    assert np.isnan(one.table.fit_m[run_rows(one.time_s, 0.0, 0.5 * HELD_S)]).all()


def test_classical_figures_agree_with_the_truth(path: str) -> None:
    analyse_run(path, ignore)
    rows = {row.name: row.classical for row in estimate_classical(AnalysisTask(path))}
    assert float(rows["period"].removesuffix("\u202fms")) == pytest.approx(320.0, rel=1e-3)
    assert float(rows["log decrement"]) == pytest.approx(0.12 * 0.32, rel=0.01)
    assert float(rows["by the paper's method"]) == pytest.approx(0.1, abs=0.002)
    assert "0.1000" in rows["from u<sub>s</sub> alone"]


def run_rows(time_s: np.ndarray, start_s: float, end_s: float) -> np.ndarray:
    return np.flatnonzero((time_s >= start_s) & (time_s <= end_s))
