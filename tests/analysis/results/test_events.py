"""Release, slip end and rest agree with the truth within u, also where f_s is close to f_d."""

import numpy as np
import pytest
from synthetic import Truth, simulate_record

from analysis.identify import identify
from analysis.preparation.free_decay import prepare
from analysis.results.fitted_quantities import find_rest


def drawn(seed):
    """A random truth; f_s is often within some per cent of f_d."""
    rng = np.random.default_rng(seed)
    friction = rng.uniform(0.06, 0.2)
    return Truth(
        friction_dynamic=friction,
        friction_static=friction * rng.choice([1.0, 1.003, 1.01, 1.02, 1.3]),
        tilt_rad=rng.choice([0.0, 1e-3]),
        noise_m=rng.choice([5e-6, 5e-5]),
        release_phase=rng.random(),
        rate_hz=300.0,
        seed=seed,
    )


def slip_end_s(truth):
    return (
        truth.hold_s
        + truth.release_phase / truth.rate_hz
        + truth.parameters().simulate(truth.duration_s).slip_end_s
    )


def test_slip_ends_and_releases_are_as_uncertain_as_they_are_said_to_be():
    off = []
    for seed in range(30):
        truth = drawn(seed)
        events = identify(simulate_record(truth)).events
        released = truth.hold_s + truth.release_phase / truth.rate_hz
        off.append(
            [
                (events.slip_end_s - slip_end_s(truth)) / events.slip_end_uncertainty_s,
                (events.release_s - released) / events.release_uncertainty_s,
            ]
        )
    beyond = np.mean(np.abs(off) > 2.0, axis=0)

    # A twentieth of them is expected beyond; of 30 there are more than 5 once in 300 times.
    assert (beyond <= 5 / 30).all()
    assert 0.1 < np.std(off, axis=0)[0] < 1.4
    assert 0.6 < np.std(off, axis=0)[1] < 1.4


def test_a_static_friction_that_is_left_open_does_not_draw_the_slip_end_away():
    """The law with f_s, hardly worse, does not tell it; the rise of chi-square above f_d does."""
    truth = Truth(
        period_s=0.21,
        damping_n1_per_s=0.24,
        plate_mass_kg=27.4,
        friction_dynamic=0.12,
        tilt_rad=-0.001572810581622027,
        pullback_m=0.006,
        rate_hz=1733.7168360551545,
        release_phase=0.5872528328144359,
        hold_s=0.9004353548123328,
        noise_m=5.614204207847139e-06,
        seed=120054,
    )

    events = identify(simulate_record(truth)).events

    assert events.slip_end_uncertainty_s < 0.2
    assert events.slip_end_s == pytest.approx(slip_end_s(truth), abs=2.0 * events.slip_end_uncertainty_s)


def test_the_uncertainty_of_the_slip_end_grows_with_the_noise():
    quiet, loud = (
        identify(simulate_record(Truth(friction_static=0.13, noise_m=noise, rate_hz=500.0))).events
        for noise in (5e-6, 1e-4)
    )

    assert loud.slip_end_uncertainty_s > 5.0 * quiet.slip_end_uncertainty_s


@pytest.mark.parametrize("changes", [{"tilt_rad": 1.5e-3}, {"friction_static": 0.2}])
def test_under_a_wrong_law_the_slip_end_is_uncertain_and_not_early(changes):
    truth = Truth(**changes)

    found = identify(simulate_record(truth), model="coulomb")

    assert not found.model.adequate
    assert found.events.slip_end_uncertainty_s > 0.01
    assert found.events.slip_end_s + 2.0 * found.events.slip_end_uncertainty_s > slip_end_s(truth)


def test_slip_to_the_end_has_no_end():
    events = identify(simulate_record(Truth(duration_s=1.5))).events

    assert events.slip_end_s is None
    assert events.slip_end_uncertainty_s is None
    assert events.release_uncertainty_s < 1e-4


def test_rest_is_as_uncertain_as_it_is_said_to_be():
    off = []
    for seed in range(40):
        truth = Truth(
            friction_dynamic=0.6,
            damping_n1_per_s=0.6,
            noise_m=5e-5,
            rate_hz=300.0,
            duration_s=12.0,
            seed=seed,
        )
        decay = prepare(simulate_record(truth))
        k1 = np.hypot(2.0 * np.pi / truth.period_s, truth.damping_n1_per_s)
        swing = truth.pullback_m * k1 * truth.period_s / (2.0 * np.pi)
        true_s = truth.hold_s + truth.release_phase / truth.rate_hz
        true_s += np.log(swing / truth.noise_m) / truth.damping_n1_per_s
        found_s, deviation_s = find_rest(decay)
        off.append((found_s - true_s) / deviation_s)

    assert 0.7 < np.std(off) < 1.3
    assert abs(np.mean(off)) < 0.5
