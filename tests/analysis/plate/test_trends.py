"""Friction of slips against sliding velocity, position and time: slopes are those of the stand."""

import numpy as np
import pytest

from analysis.laws.stand_parts import stand_displacements
from analysis.plate.friction import PlateFriction, estimate_plate_friction
from analysis.plate.trends import (
    FrictionTrend,
    trend_with_position,
    trend_with_time,
    trend_with_velocity,
    velocity_statement,
)
from analysis.preparation.free_decay import prepare
from analysis.synthetic import Truth, simulate_record

_TRUTH = Truth(friction_static=0.12, tilt_rad=1e-3)


_FAST = Truth(
    period_s=0.28,
    damping_n1_per_s=0.1,
    plate_mass_kg=27.4,
    friction_dynamic=0.15,
    pullback_m=0.009,
    rate_hz=4000.0,
    noise_m=4e-5,
)


def _plate(seed: int = 0, truth: Truth = _TRUTH, **effects: float) -> PlateFriction:
    motion = stand_displacements(truth.parameters(), effects, truth.duration_s + 1e-3) if effects else None
    record = simulate_record(truth.replace(seed=seed), motion)
    found = estimate_plate_friction(record, prepare(record))
    assert found is not None
    return found


def _trends(plate: PlateFriction) -> tuple[FrictionTrend, ...]:
    return trend_with_velocity(plate), trend_with_position(plate), trend_with_time(plate, 1.0)


def test_constant_friction_has_no_slope_and_agrees_with_the_paper() -> None:
    plate = _plate()
    for trend in _trends(plate):
        assert trend.includes_zero
        line, half_width = trend.line(trend.at)
        assert np.all(np.abs(line - 0.1) < 1.5 * half_width)
    assert "per 100 mm/s" in str(velocity_statement(plate))
    assert "this run agrees with the paper" in str(velocity_statement(plate))


@pytest.mark.parametrize("truth", [_TRUTH.replace(duration_s=5.0), _FAST], ids=["usual", "fast"])
def test_slopes_cover_zero_where_friction_is_constant(truth: Truth) -> None:
    """Slopes over their uncertainties have mean 0 and rms 1.

    Of fast and noisy readings they once had means of 2.5 to 3.2, and those of time an rms of 0.4.
    """
    scores = np.array([
        [trend.slope / trend.slope_standard_uncertainty for trend in _trends(_plate(seed, truth))]
        for seed in range(20)
    ])  # fmt: skip
    assert (np.abs(scores.mean(axis=0)) < 3.5 / np.sqrt(len(scores))).all()
    rms = np.sqrt(np.mean(scores**2, axis=0))
    assert ((rms > 0.6) & (rms < 1.5)).all()


def test_a_film_gives_its_slope_with_velocity_and_contradicts_the_paper() -> None:
    plate = _plate(film_s_per_m=1.0)
    trend = trend_with_velocity(plate)
    assert trend.slope == pytest.approx(0.1, abs=3.0 * trend.slope_standard_uncertainty)
    assert "f_d depends on velocity, against the paper" in str(velocity_statement(plate))


def test_slips_lie_on_the_line_of_a_film() -> None:
    """At mean speeds they once lay on a line a third steeper: a parabola weighs the fast middle of a slip."""
    trend = trend_with_velocity(_plate(film_s_per_m=1.0))
    away = trend.friction - trend.level - trend.slope * (trend.at - trend.centre)
    is_clear = trend.half_width_95 < 1e-3
    assert is_clear.sum() > 5
    assert np.abs(away[is_clear]).max() < 1e-3
    assert np.ptp(trend.friction[is_clear]) > 1e-2


def test_friction_that_rises_along_the_track_is_not_taken_for_one_that_rises_with_velocity() -> None:
    """Velocity and position of slips are related: each slope alone stands for both."""
    plate = _plate(friction_gradient_per_m=3.0)
    trend = trend_with_position(plate)
    assert trend.slope == pytest.approx(0.3, abs=3.0 * trend.slope_standard_uncertainty)
    assert trend_with_velocity(plate).includes_zero


def test_a_slip_that_tells_nothing_does_not_stretch_what_is_drawn() -> None:
    trend = trend_with_velocity(_plate(film_s_per_m=0.5))
    low, high = trend.value_range()
    assert trend.half_width_95.max() > high - low
    assert 0.09 < low < high < 0.12
