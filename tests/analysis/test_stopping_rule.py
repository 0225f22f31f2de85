"""Predicted gain of a longer record against longer records."""

import numpy as np
import pytest

from analysis.preparation.channels import Channel
from analysis.preparation.oscillation import damped_cosine, fit_damped_cosine
from analysis.stopping_rule import is_worth_waiting, tail_variance_reduction


def tail_until(end_s, seed=0):
    time_s = np.arange(0.0, end_s, 0.002)
    curve, _ = damped_cosine(np.array([0.12, 2.0 * np.pi / 0.32, 4e-3, 1e-3, 2e-4]), time_s)
    noise = 2e-5 * np.random.default_rng(seed).standard_normal(len(time_s))
    return fit_damped_cosine(Channel(time_s, curve + noise), 0.32)


@pytest.mark.parametrize("now_s", [4.0, 9.0, 14.0])
def test_the_promised_covariance_is_that_of_the_longer_tail(now_s):
    now, then = tail_until(now_s), tail_until(18.0)

    period, damping = tail_variance_reduction(now, 18.0)

    assert 1.0 - period == pytest.approx(
        (then.period_uncertainty_s / now.period_uncertainty_s) ** 2, rel=0.08
    )
    assert 1.0 - damping == pytest.approx(
        (then.damping_uncertainty_per_s / now.damping_uncertainty_per_s) ** 2, rel=0.08
    )


def test_nothing_is_promised_after_the_end():
    assert tail_variance_reduction(tail_until(6.0), 5.0).tolist() == [0.0, 0.0]


def test_a_twentieth_is_worth_it():
    assert is_worth_waiting(1.0, 1.0 - 0.94**2)
    assert not is_worth_waiting(1.0, 1.0 - 0.96**2)
