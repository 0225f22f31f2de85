"""The paper's algorithm: what it gives at its own step, and what it converges to."""

import math

import numpy as np
import pytest

from analysis.motion import paper_method
from analysis.motion.two_mass import MotionError, TwoMassParameters
from benchmarks.reference_solvers import march_like_the_paper

FIRST = TwoMassParameters.from_free_decay(
    period_s=0.32,
    damping_n1_per_s=0.12,
    table_mass_kg=131.6,
    plate_mass_kg=22.4,
    friction_dynamic=0.1,
    pullback_m=0.012,
)


def changed(**changes):
    return TwoMassParameters(**{**vars(FIRST), **changes})


def test_first_series_ends_where_the_paper_s_step_takes_it():
    motion = paper_method.simulate(FIRST)
    assert motion.residual_displacement_m == pytest.approx(-0.01023, abs=5e-6)
    assert FIRST.simulate().residual_displacement_m == pytest.approx(-0.010265, abs=5e-7)


def test_error_shrinks_with_the_step():
    times = np.linspace(0.0, 10.0, 2001)
    exact = FIRST.simulate().sample(times)
    errors = []
    for step in (1e-3, 1e-4, 1e-5, 1e-6):
        samples = paper_method.simulate(FIRST, step_s=step).sample(times)
        errors.append(
            max(
                np.abs(samples.table_displacement_m - exact.table_displacement_m).max(),
                np.abs(samples.relative_displacement_m - exact.relative_displacement_m).max(),
            )
        )
    assert 2e-5 < errors[1] < 1e-4
    assert errors[0] > 3 * errors[1] > 9 * errors[2]
    # What is left is the damped frequency of Eq. (6), which no step cures.
    assert errors[3] < 5e-6


def test_compiled_steps_are_those_of_a_plain_loop_over_the_printed_formulas():
    plain = march_like_the_paper(FIRST, duration_s=3.0, step_s=1e-3)
    motion = paper_method.simulate(FIRST, duration_s=3.0, step_s=1e-3)
    samples = motion.sample(np.arange(3000) * 1e-3 + 1e-9)
    assert samples.phase.tolist() == plain.signs
    nodes = motion.sample(np.arange(3001) * 1e-3)
    np.testing.assert_allclose(nodes.table_displacement_m, plain.table_m, rtol=0, atol=1e-13)
    np.testing.assert_allclose(nodes.relative_displacement_m, plain.relative_m, rtol=0, atol=1e-12)


def test_motion_without_slip_is_exact():
    stuck = changed(friction_dynamic=0.6)
    times = np.linspace(0.0, 10.0, 777)
    motion, exact = paper_method.simulate(stuck), stuck.simulate()
    assert motion.phase_signs.tolist() == [0]
    assert motion.slip_end_s == motion.residual_displacement_m == 0.0
    for name, column in motion.sample(times).columns().items():
        np.testing.assert_allclose(column, exact.sample(times).columns()[name], rtol=0, atol=1e-11)


def test_largest_rates_come_near_the_exact_ones():
    motion, exact = paper_method.simulate(FIRST), FIRST.simulate()
    for name in (
        "table_velocity_max_m_per_s",
        "plate_velocity_max_m_per_s",
        "table_acceleration_max_m_per_s2",
    ):
        assert getattr(motion, name) == pytest.approx(getattr(exact, name), rel=2e-3)


def test_a_step_over_a_reversal_counts_as_joint_motion():
    """The plate seems pushed harder than friction can; compare 3.75 m/s2 at 0.3 s in the paper's Fig. 5."""
    motion = paper_method.simulate(FIRST)
    friction = FIRST.friction_dynamic * FIRST.gravity_m_per_s2
    assert FIRST.simulate().plate_acceleration_max_m_per_s2 == pytest.approx(friction, rel=1e-12)
    assert 3.5 < motion.plate_acceleration_max_m_per_s2 < 4.0
    samples = motion.sample((np.arange(100_000) + 0.5) * 1e-4)
    worst = np.argmax(np.abs(samples.plate_acceleration_m_per_s2))
    assert samples.phase[worst] == 0
    assert samples.time_s[worst] == pytest.approx(0.29, abs=0.01)


def test_between_steps_the_motion_is_continuous():
    motion = paper_method.simulate(FIRST, duration_s=2.0, step_s=1e-3)
    nodes = np.arange(1, 2000) * 1e-3
    before, after = motion.sample(nodes - 1e-12), motion.sample(nodes + 1e-12)
    for name in ("table_displacement_m", "relative_displacement_m"):
        np.testing.assert_allclose(before.columns()[name], after.columns()[name], rtol=0, atol=1e-11)


def test_before_release_the_table_is_held():
    samples = paper_method.simulate(FIRST, duration_s=1.0).sample([-0.5])
    assert samples.table_displacement_m.tolist() == [0.012]
    assert samples.table_acceleration_m_per_s2.tolist() == [0.0]


@pytest.mark.parametrize(
    ("parameters", "arguments", "message"),
    [
        (changed(friction_static=0.2), {}, "friction_static is 0.2, but the paper's method knows only"),
        (changed(tilt_rad=0.001), {}, "tilt_rad is 0.001, but the paper's method knows no tilt"),
        (FIRST, {"duration_s": 0.0}, "duration_s is 0"),
        (FIRST, {"step_s": 0.0}, "step_s is 0"),
        (FIRST, {"step_s": 11.0}, "step_s is 11: give more than 0 and at most the duration, 10"),
        (FIRST, {"step_s": math.nan}, "step_s is nan"),
        (FIRST, {"step_s": 1e-7}, "step_s is 1e-07, 100000000 steps: give at least 1e-06"),
    ],
)
def test_what_the_method_cannot_do_is_named(parameters, arguments, message):
    with pytest.raises(MotionError, match=message):
        paper_method.simulate(parameters, **arguments)
