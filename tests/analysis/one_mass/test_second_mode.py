"""A second mode is named, with frequency and size; what a spring or damping of another law leaves is not."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analysis.one_mass.fit import fit_with_friction
from analysis.one_mass.identify import identify_one_mass, single_channel
from analysis.one_mass.residuals import find_second_mode
from analysis.preparation.channels import Channel

PERIOD_S, DAMPING_PER_S, NOISE = 0.5, 0.1, 1e-3
OMEGA = 2.0 * math.pi / PERIOD_S
TIME_S = np.arange(0.0, 12.0, 0.01)


def decay(force, noise=NOISE, seed=0):
    """Readings of u'' = -force(u, u'), released at 1, integrated by DOP853."""
    found = solve_ivp(
        lambda _, s: [s[1], -force(*s)], (0.0, 12.0), [1.0, 0.0], "DOP853", TIME_S, rtol=1e-9, atol=1e-12
    )
    return found.y[0] + noise * np.random.default_rng(seed).standard_normal(len(TIME_S))


def linear(u, v):
    return OMEGA**2 * u + 2.0 * DAMPING_PER_S * v


OTHER_LAWS = {
    "hardening": lambda u, v: linear(u, v) + 0.02 * OMEGA**2 * u**3,
    "softening": lambda u, v: linear(u, v) - 0.05 * OMEGA**2 * u**3,
    "stiffer on one side": lambda u, v: linear(u, v) + 0.05 * OMEGA**2 * u**2,
    "drag": lambda u, v: linear(u, v) + 0.02 * abs(v) * v,
    "damping that rises": lambda u, v: linear(u, v) + 4.0 * DAMPING_PER_S * u**2 * v,
    "friction that falls with velocity": lambda u, v: (
        linear(u, v) + 0.01 * OMEGA**2 * math.tanh(v / 0.02) * (1.0 + 0.5 * math.exp(-abs(v)))
    ),
}


def second_mode_in(value, step=0.0):
    found = fit_with_friction(Channel(TIME_S, value), PERIOD_S, 0)
    return find_second_mode(found.channel.time_s, found.residual, found.parameters.period_s, step)


@pytest.mark.parametrize("law", OTHER_LAWS)
@pytest.mark.parametrize("noise", [1e-4, 1e-3, 1e-2])
def test_another_law_leaves_no_second_mode(law, noise):
    assert second_mode_in(decay(OTHER_LAWS[law], noise)) is None


@pytest.mark.parametrize("step", [0.003, 0.02, 0.05])
def test_rounding_is_no_second_mode(step):
    assert second_mode_in(np.round(decay(linear, 0.0) / step) * step, step) is None


def test_white_noise_is_rarely_a_second_mode():
    random = np.random.default_rng(1)
    found = [find_second_mode(TIME_S, random.standard_normal(len(TIME_S)), PERIOD_S, 0.0) for _ in range(500)]
    assert sum(line is not None for line in found) <= 3


@pytest.mark.parametrize("frequency_hz", [3.1, 5.2, 7.7, 23.3])
@pytest.mark.parametrize("law", ["drag", "hardening"])
def test_a_second_mode_is_told_beside_another_law(frequency_hz, law):
    mode = 0.02 * np.exp(-0.4 * TIME_S) * np.sin(2.0 * math.pi * frequency_hz * TIME_S)
    line = second_mode_in(decay(OTHER_LAWS[law]) + mode)

    assert line is not None
    assert line.frequency_hz == pytest.approx(frequency_hz, abs=0.05)
    assert line.amplitude == pytest.approx(0.02, rel=0.3)


def test_a_mass_on_the_mass_is_told_with_frequency_and_size():
    """Two masses on springs, of which the first is read: eigenvalues give frequency and share."""
    matrix = np.array([[OMEGA**2 * 1.05, -0.05 * OMEGA**2], [-(14.0**2), 14.0**2]])
    squares, shapes = (part.real for part in np.linalg.eig(matrix))  # complex since NumPy 2.5
    shares = np.linalg.solve(shapes, [1.0, 0.0]) * shapes[0]
    second = int(np.argmin(np.abs(shares)))
    motion = solve_ivp(
        lambda _, s: [*s[2:], *(-matrix @ s[:2] - 0.3 * s[2:])],
        (0.0, 12.0), [1.0, 0.0, 0.0, 0.0], "DOP853", TIME_S, rtol=1e-9, atol=1e-12,
    )  # fmt: skip
    noise = NOISE * np.random.default_rng(3).standard_normal(len(TIME_S))
    found = identify_one_mass(single_channel(TIME_S, motion.y[0] + noise))
    (warning,) = [one for one in found.warnings if one.code == "second-mode"]
    told = warning.message.values

    assert float(told["frequency_hz"]) == pytest.approx(math.sqrt(squares[second]) / 2.0 / math.pi, rel=0.02)
    assert told["share"] == pytest.approx(100.0 * abs(shares[second]) / shares.sum(), rel=0.2)
