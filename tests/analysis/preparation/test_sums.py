"""Compiled sums over readings, against the same by numpy."""

import numpy as np
import pytest

from analysis.preparation.channels import Channel, detrended_noise
from analysis.preparation.oscillation import damped_cosine
from analysis.preparation.sums import cubic_weights, swing_equations, wave_amplitudes, windows

RNG = np.random.default_rng(4)
EVEN_S = 2e-3 * np.arange(700)
UNEVEN_S = np.sort(RNG.uniform(0.0, 1.4, 700))
GRIDS = pytest.mark.parametrize("time_s", [EVEN_S, UNEVEN_S], ids=["even", "uneven"])


@GRIDS
@pytest.mark.parametrize("half_s", [0.0, 1e-3, 0.03, 5.0])
def test_windows_are_those_of_a_binary_search(time_s, half_s):
    first, past = windows(time_s, half_s)

    assert (first == np.searchsorted(time_s, time_s - half_s)).all()
    assert (past == np.searchsorted(time_s, time_s + half_s, "right")).all()


@GRIDS
def test_the_equations_of_a_damped_cosine_are_products_of_its_derivatives(time_s):
    parameters = np.array([0.3, 19.0, 2e-3, -1e-3, 3e-4])
    readings = 1e-3 * RNG.standard_normal(len(time_s))
    curve, columns = damped_cosine(parameters, time_s)
    rows = np.vstack((columns, readings - curve))

    assert swing_equations(parameters, time_s, readings) == pytest.approx(rows @ rows.T, rel=1e-9, abs=1e-14)


@GRIDS
def test_amplitudes_of_waves_are_those_of_a_fourier_sum(time_s):
    frequencies_hz, readings = np.array([35.0, 50.0, 120.0]), RNG.standard_normal(len(time_s))
    turns = np.exp(2j * np.pi * np.outer(frequencies_hz, time_s))

    expected = 2.0 / len(time_s) * np.abs(turns @ readings)
    assert wave_amplitudes(time_s, readings, frequencies_hz) == pytest.approx(expected, rel=1e-10)


@GRIDS
def test_a_cubic_is_met_by_its_neighbours(time_s):
    cubic = 1.0 + time_s - 2.0 * time_s**2 + 0.5 * time_s**3

    weights, widest_s = cubic_weights(time_s)

    w0, w1, w2, w3 = weights[:, 2:-2]
    met = w0 * cubic[:-4] + w1 * cubic[1:-3] + w2 * cubic[3:-1] + w3 * cubic[4:]
    assert met == pytest.approx(cubic[2:-2], rel=1e-9)
    steps = np.diff(time_s)
    assert (widest_s[2:-2] == np.max([steps[k : len(steps) - 3 + k] for k in range(4)], axis=0)).all()


@GRIDS
def test_noise_about_lines_over_blocks_is_that_of_a_line_fitted_to_each(time_s):
    """Blocks of under six readings are left out; so are the few of the last block here."""
    channel, squares, freedom = Channel(time_s, 5.0 + time_s**2 + RNG.standard_normal(len(time_s))), 0.0, 0
    for first_s in np.arange(time_s[0], time_s[-1], 0.011):
        t, x = (part := channel.between(first_s, first_s + 0.011)).time_s, part.value_m
        if len(t) >= 6:
            squares += float(np.sum((x - np.polyval(np.polyfit(t - t[0], x, 1), t - t[0])) ** 2))
            freedom += len(t) - 2

    assert detrended_noise(channel, 0.011) == pytest.approx(np.sqrt(squares / freedom), rel=1e-9)
