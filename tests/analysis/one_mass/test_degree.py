"""The degree of a verdict on one mass: noise, a part, halves that agree, or nothing that can be told."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analysis.identification import Degree
from analysis.motion.one_mass import OneMassDecay, simulate
from analysis.one_mass.identify import identify_one_mass, single_channel
from analysis.quantities import BudgetSource
from analysis.record import RecordError
from analysis.verdict_text import describe_verdict

OMEGA, DAMPING_PER_S = 4.0 * math.pi, 0.1
TIME_S = np.arange(0.0, 10.0, 0.005)


def identified(loss=lambda _: 0.0, added=0.0, seed=1):
    """A decay with a further loss of force, integrated by DOP853, and readings `added` to it."""

    def motion(_, state):
        u, v = state
        return [v, -(OMEGA**2) * u - 2.0 * DAMPING_PER_S * v - loss(v)]

    found = solve_ivp(motion, (0.0, 10.0), [1.0, 0.0], "DOP853", TIME_S, rtol=1e-9, atol=1e-12)
    noise = 3e-4 * np.random.default_rng(seed).standard_normal(len(TIME_S))
    return identify_one_mass(single_channel(TIME_S, found.y[0] + added + noise))


def decaying(share, damping_per_s, frequency_hz):
    return share * np.exp(-damping_per_s * TIME_S) * np.sin(2.0 * math.pi * frequency_hz * TIME_S)


def test_noise_alone_is_ideal():
    found = identified()
    assert found.model.degree is Degree.IDEAL
    assert found.model.adequate


@pytest.mark.parametrize("frequency_hz", [5.3, 17.7])
@pytest.mark.parametrize("share", [0.004, 0.02])
def test_period_and_damping_hold_beside_a_small_second_mode(share, frequency_hz):
    found = identified(added=decaying(share, 0.3, frequency_hz))

    assert found.model.degree is Degree.FRICTION
    assert not found.model.adequate
    assert found.model.residual_share < 0.02
    assert "T and n hold" in str(describe_verdict(found.model, found.kind))
    assert any(line.source is BudgetSource.MODEL for line in found.budget)
    for name, true in (("period_s", 2.0 * math.pi / math.sqrt(OMEGA**2 - DAMPING_PER_S**2)),
                       ("damping_n_per_s", DAMPING_PER_S)):  # fmt: skip
        assert abs(found.results[name].value - true) < 3.0 * found.results[name].standard_uncertainty
        assert found.results[name].standard_uncertainty < 0.2 * true


def test_friction_that_rises_at_low_speed_leaves_a_period_that_holds():
    found = identified(
        loss=lambda v: 0.02 * OMEGA**2 * math.tanh(v / 0.01) * (1.0 + 0.6 * math.exp(-((v / 2.0) ** 2)))
    )

    assert found.model.degree is Degree.FRICTION
    assert found.labels["coulomb_significant"] is True
    assert found.results["period_s"].value == pytest.approx(0.5, rel=0.005)
    assert 0.02 < found.results["coulomb_displacement_m"].value < 0.035


@pytest.mark.parametrize(
    "added",
    [decaying(0.5, 0.1, 3.1), decaying(0.4, 0.02, 2.2), 0.4 * np.sin(2.0 * math.pi * 2.3 * TIME_S + 1.0)],
    ids=["two modes", "two near modes", "driven"],
)
def test_what_is_no_single_decay_is_refused_or_not_told(added):
    try:
        found = identified(added=added)
    except RecordError:
        return
    assert found.model.degree is Degree.NONE
    assert "cannot be told" in str(describe_verdict(found.model, found.kind))


@pytest.mark.parametrize("frequency_hz", [1.98, 2.0, 2.05])
@pytest.mark.parametrize(("share", "phase"), [(0.4, 1.0), (0.4, 2.0), (0.05, 1.0), (0.05, 3.0)])
def test_a_steady_drive_near_resonance_is_told_and_nothing_holds(frequency_hz, share, phase):
    """Halves of such a record agree on an n that is up to half too small."""
    found = identified(added=share * np.sin(2.0 * math.pi * frequency_hz * TIME_S + phase))

    assert found.model.degree is Degree.NONE
    (warning,) = [one for one in found.warnings if one.code == "steady-drive"]
    assert float(warning.message.values["frequency_hz"]) == pytest.approx(frequency_hz, rel=0.005)


@pytest.mark.parametrize("length_s", [4.0, 10.0])
def test_friction_that_stops_the_mass_is_no_drive(length_s):
    """A decay less a steady oscillation of the opposite phase ends as dry friction does."""
    motion = simulate(OneMassDecay(0.5, 0.05, 0.03, 0.0, 1.0), TIME_S).displacement_m
    bent = motion + 0.01 * motion**2 + 1e-4 * np.random.default_rng(1).standard_normal(len(TIME_S))
    kept = length_s > TIME_S
    found = identify_one_mass(single_channel(TIME_S[kept], bent[kept]))

    assert not found.model.adequate
    assert "steady-drive" not in [warning.code for warning in found.warnings]


def test_noise_that_would_hide_a_second_mode_is_told():
    """A twentieth of the swing: with it T and n of half a record may be wrong, and no test sees it."""
    random = np.random.default_rng(1)
    time_s = TIME_S[::8]
    value = np.exp(-DAMPING_PER_S * time_s) * np.cos(OMEGA * time_s)
    found = identify_one_mass(single_channel(time_s, value + 0.3 * random.standard_normal(len(time_s))))

    assert found.model.degree is Degree.NONE
    (warning,) = [one for one in found.warnings if one.code == "noise-hides-modes"]
    assert 8.0 < warning.message.values["share"] < 20.0


def test_a_pull_through_the_middle_is_not_fitted():
    """From rest a hand moves the mass to one side and then far to the other, where it lets go."""
    before_s = np.arange(-1.0, 0.0, 0.005)
    hand = np.interp(before_s, [-0.8, -0.5, 0.0], [0.0, 0.1, -1.0])
    value = np.concatenate((hand, -np.exp(-DAMPING_PER_S * TIME_S) * np.cos(OMEGA * TIME_S)))
    value += 1e-3 * np.random.default_rng(1).standard_normal(len(value))
    found = identify_one_mass(single_channel(np.concatenate((before_s, TIME_S)), value))

    assert found.model.degree is Degree.IDEAL
    damping = found.results["damping_n_per_s"]
    assert abs(damping.value - DAMPING_PER_S) < 3.0 * damping.standard_uncertainty < 0.02
