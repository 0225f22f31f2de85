"""Compiled sums over readings, against the same by numpy."""

import numpy as np
import pytest

from analysis.preparation.channels import Channel, detrended_noise
from analysis.preparation.oscillation import damped_cosine
from analysis.preparation.sums import (
    median_of_five,
    off_cubic,
    swing_equations,
    swing_residual,
    wave_amplitudes,
    widest_intervals,
    window_means,
    window_slopes,
)

RNG = np.random.default_rng(4)
EVEN_S = 2e-3 * np.arange(700)
UNEVEN_S = np.sort(RNG.uniform(0.0, 1.4, 700))
GRIDS = pytest.mark.parametrize("time_s", [EVEN_S, UNEVEN_S], ids=["even", "uneven"])


@GRIDS
@pytest.mark.parametrize("half_s", [0.0, 1e-3, 0.03, 5.0])
def test_means_and_slopes_are_of_the_readings_that_a_binary_search_finds(time_s, half_s):
    readings = 5e-3 + 1e-3 * RNG.standard_normal(len(time_s))
    first, past = np.searchsorted(time_s, time_s - half_s), np.searchsorted(time_s, time_s + half_s, "right")
    of_five = np.arange(len(time_s))

    means = [readings[a:b].mean() for a, b in zip(first, past, strict=True)]
    assert window_means(time_s, readings, half_s) == pytest.approx(means, rel=1e-12)
    wide = zip(
        np.minimum(first, np.maximum(of_five - 2, 0)),
        np.maximum(past, np.minimum(of_five + 3, len(time_s))),
        strict=True,
    )
    slopes = [np.polyfit(time_s[a:b] - time_s[a], readings[a:b], 1)[0] for a, b in wide]
    assert window_slopes(time_s, readings, half_s) == pytest.approx(slopes, rel=1e-6, abs=1e-9)


def test_sums_over_windows_are_made_anew_before_their_rounding_errors_grow():
    """One reading of 1e9 is in the sums of few windows; what rounding leaves of it must not stay in them."""
    time_s = 1e-5 * np.arange(100_000)
    readings = np.where(np.arange(100_000) == 7, 1e9, 1.0)

    assert window_means(time_s, readings, 5e-5)[20_000:].tolist() == pytest.approx([1.0] * 80_000, rel=1e-12)
    assert window_slopes(time_s, readings, 5e-5)[20_000:].tolist() == pytest.approx([0.0] * 80_000, abs=1e-7)


@GRIDS
def test_the_equations_of_a_damped_cosine_are_products_of_its_derivatives(time_s):
    parameters = np.array([0.3, 19.0, 2e-3, -1e-3, 3e-4])
    readings = 1e-3 * RNG.standard_normal(len(time_s))
    curve, columns = damped_cosine(parameters, time_s)
    rows = np.vstack((columns, readings - curve))

    assert swing_equations(parameters, time_s, readings) == pytest.approx(rows @ rows.T, rel=1e-9, abs=1e-14)
    assert swing_residual(parameters, time_s, readings) == pytest.approx(
        readings - curve, rel=1e-9, abs=1e-15
    )


@GRIDS
def test_amplitudes_of_waves_are_those_of_a_fourier_sum(time_s):
    frequencies_hz, readings = np.array([35.0, 50.0, 120.0]), RNG.standard_normal(len(time_s))
    turns = np.exp(2j * np.pi * np.outer(frequencies_hz, time_s))

    expected = 2.0 / len(time_s) * np.abs(turns @ readings)
    assert wave_amplitudes(time_s, readings, frequencies_hz) == pytest.approx(expected, rel=1e-10)


@GRIDS
def test_a_cubic_is_met_by_its_neighbours(time_s):
    cubic = 1.0 + time_s - 2.0 * time_s**2 + 0.5 * time_s**3

    off = off_cubic(time_s, cubic + np.where(np.arange(len(time_s)) == 350, 1e-3, 0.0))

    away = np.abs(np.arange(len(time_s)) - 350) <= 2
    assert off[~away] == pytest.approx(0.0, abs=1e-9)
    near = time_s[[348, 349, 351, 352]] - time_s[350]
    weights = [np.prod([b / (b - a) for b in near if b != a]) for a in near]
    assert off[350] == pytest.approx(
        1e-3 * np.sqrt(35.0 / 18.0 / (1.0 + np.sum(np.square(weights)))), rel=1e-6
    )
    steps, widest_s = np.diff(time_s), widest_intervals(time_s)
    assert np.isinf(widest_s[[0, 1, -2, -1]]).all()
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


def test_medians_of_five_repeat_the_reading_at_each_end():
    readings = RNG.standard_normal(400)
    padded = np.concatenate((readings[[0, 0]], readings, readings[[-1, -1]]))

    assert (median_of_five(readings) == [np.median(padded[k : k + 5]) for k in range(400)]).all()
