"""Finding release, hold, disturbance and slip end in readings of a known motion."""

import numpy as np
import pytest
from synthetic import Truth, simulate_readings

from analysis.preparation.channels import Channel
from analysis.preparation.oscillation import (
    find_last_slip,
    find_releases,
    local_slopes,
    median_of_three,
    white_noise,
)
from analysis.record import RecordError


def channels(truth):
    time, table, relative = simulate_readings(truth)
    return Channel(time, table), Channel(time, relative)


@pytest.mark.parametrize("rate_hz", [200.0, 1000.0, 5000.0])
@pytest.mark.parametrize("noise_m", [0.0, 5e-6, 1e-4])
def test_release_is_found_to_some_milliseconds(rate_hz, noise_m):
    table, _ = channels(Truth(rate_hz=rate_hz, noise_m=noise_m, duration_s=5.0))

    (release,) = find_releases(table)

    assert release.time_s == pytest.approx(1.0 + 0.3 / rate_hz, abs=0.006)
    assert release.plateau_start_s < 0.05
    assert release.level_m == pytest.approx(0.0123, abs=3e-5)
    assert release.end_s == pytest.approx(table.time_s[-1], abs=0.05)


@pytest.mark.parametrize("rate_hz", [31.0, 33.0, 40.0, 50.0])
@pytest.mark.parametrize("seed", range(5))
def test_a_hold_is_found_in_few_readings_of_which_some_are_missing(rate_hz, seed):
    table, _ = channels(Truth(rate_hz=rate_hz, noise_m=2e-5, duration_s=5.0, seed=seed))
    kept = np.random.default_rng(seed).random(len(table)) > 0.1
    late = np.flatnonzero((table.time_s > 0.86) & (table.time_s < 1.0))
    kept[late[::2]] = False  # half of the last tenth of a second of the hold

    (release,) = find_releases(Channel(table.time_s[kept], table.value_m[kept]))

    assert release.time_s == pytest.approx(1.0, abs=2.0 / rate_hz)
    assert release.plateau_start_s is not None
    assert release.plateau_start_s < 0.6
    assert release.level_m == pytest.approx(0.0123, abs=3e-5)


def test_hold_is_told_from_the_rest_and_the_pull_before_it():
    table, _ = channels(Truth(pull_s=2.0, duration_s=5.0))

    (release,) = find_releases(table)

    assert release.time_s == pytest.approx(7.0, abs=0.006)
    assert 5.9 < release.plateau_start_s < 6.5


@pytest.mark.parametrize("seed", range(3))
def test_hold_begins_where_a_smooth_pull_has_ended(seed):
    truth = Truth(pull_s=0.6, hold_s=0.6, rate_hz=2000.0, noise_m=2e-5, duration_s=5.0, seed=seed)
    table, _ = channels(truth)

    (release,) = find_releases(table)

    held = table.between(release.plateau_start_s, release.plateau_start_s + 0.04).value_m
    assert abs(held.mean() - 0.0123) < 5.0 * 2e-5 / np.sqrt(len(held)) + 2e-6
    assert release.time_s - release.plateau_start_s > 0.4


def test_a_record_that_begins_after_the_release_has_no_hold():
    table, _ = channels(Truth(duration_s=5.0))

    (release,) = find_releases(table.between(1.2, np.inf))

    assert release.plateau_start_s is None
    assert release.time_s == pytest.approx(1.2, abs=1e-9)


@pytest.mark.parametrize("pull_s", [0.6, 2.0])
def test_a_second_pull_ends_the_first_motion_and_its_release_is_the_second(pull_s):
    first, _ = channels(Truth(duration_s=5.0, noise_m=5e-6))
    stop = int(np.searchsorted(first.time_s, 3.0))
    ramp = 0.5 - 0.5 * np.cos(np.pi * np.linspace(0.0, 1.0, int(pull_s * 1000)))
    pulled = first.value_m[stop] + (first.value_m[0] - first.value_m[stop]) * ramp
    value = np.concatenate((first.value_m[:stop], pulled, first.value_m[:]))
    table = Channel(np.arange(len(value)) / 1000.0, value)

    one, two = find_releases(table)

    assert one.time_s == pytest.approx(1.0, abs=0.006)
    assert one.end_s == pytest.approx(3.0, abs=0.35)
    assert two.time_s == pytest.approx(4.0 + pull_s, abs=0.006)


def test_hum_and_spikes_do_not_look_like_a_second_release():
    table, _ = channels(Truth(duration_s=8.0, noise_m=5e-6))
    value = table.value_m + 5e-5 * np.sin(2.0 * np.pi * 50.0 * table.time_s)
    value[[500, 2000, 7000]] += 3e-3

    (release,) = find_releases(Channel(table.time_s, value))

    assert release.time_s == pytest.approx(1.0, abs=0.006)


def test_rest_is_refused():
    rest = Channel(np.arange(2000) / 500.0, 1e-5 * np.random.default_rng(2).standard_normal(2000))

    with pytest.raises(RecordError, match="no release"):
        find_releases(rest)


def test_slip_end_is_found_to_a_quarter_period_and_not_before_the_last_slip():
    truth = Truth(noise_m=5e-6, friction_static=0.2, duration_s=6.0)
    _, relative = channels(truth)
    end_s = truth.parameters().simulate(6.0).slip_end_s + 1.0

    found = find_last_slip(relative, 1.0, 0.32, 5e-6)

    assert end_s <= found <= end_s + 0.5 * 0.32


def test_slip_that_lasts_to_the_end_has_no_end():
    _, relative = channels(Truth(duration_s=1.0))

    assert find_last_slip(relative, 1.0, 0.32, 2e-5) is None


def test_no_slip_ends_at_the_release():
    still = Channel(np.arange(3000) / 500.0, 1e-5 * np.random.default_rng(4).standard_normal(3000))

    assert find_last_slip(still, 1.0, 0.3, 1e-5) == 1.0


def test_a_steady_drift_is_no_slip():
    time = np.arange(3000) / 500.0
    drifting = Channel(time, 2e-5 * time + 1e-5 * np.random.default_rng(4).standard_normal(3000))

    assert find_last_slip(drifting, 1.0, 0.3, 1e-5) == 1.0


def test_local_slopes_of_a_line_are_its_slope_at_uneven_times():
    time = np.cumsum(np.random.default_rng(5).uniform(1e-3, 5e-3, 400))

    assert local_slopes(Channel(time, 3.0 * time - 1.0), 0.01) == pytest.approx(3.0, abs=1e-6)


def test_noise_is_that_of_the_readings_whatever_they_follow():
    table, _ = channels(Truth(noise_m=3e-5, duration_s=9.0))

    assert white_noise(table) == pytest.approx(3e-5, rel=0.04)


def test_median_of_three_takes_single_spikes_away():
    value = np.linspace(0.0, 1.0, 50)
    spiked = value.copy()
    spiked[[10, 30]] += 5.0

    smooth = median_of_three(Channel(value, spiked)).value_m

    assert np.abs(smooth - value).max() < 0.03


@pytest.mark.parametrize("seed", range(8))
def test_gaps_do_not_look_like_a_second_release(seed):
    rng = np.random.default_rng(seed)
    table, _ = channels(Truth(friction_static=0.14, seed=seed))
    kept = np.ones(len(table), dtype=bool)
    for start_s in rng.uniform(1.1, 10.0, 6):
        kept &= (table.time_s < start_s) | (table.time_s > start_s + 0.005 * 80.0 ** rng.random())

    (release,) = find_releases(Channel(table.time_s[kept], table.value_m[kept]))

    assert release.time_s == pytest.approx(1.0, abs=0.006)


def test_a_second_pull_beside_a_gap_is_still_seen():
    first, _ = channels(Truth(duration_s=5.0))
    ramp = 0.5 - 0.5 * np.cos(np.pi * np.linspace(0.0, 1.0, 600))
    pulled = first.value_m[3000] + (first.value_m[0] - first.value_m[3000]) * ramp
    value = np.concatenate((first.value_m[:3000], pulled, first.value_m))
    time = np.arange(len(value)) / 1000.0
    kept = (time < 2.6) | (time > 2.75)

    one, two = find_releases(Channel(time[kept], value[kept]))

    assert one.time_s == pytest.approx(1.0, abs=0.006)
    assert two.time_s == pytest.approx(4.6, abs=0.006)
