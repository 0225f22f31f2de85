"""Stuck and spiked readings are invalid. Readings without noise and readings beside gaps are valid."""

import numpy as np
import pytest
from synthetic import Truth, simulate_readings, table_1_by_series

from analysis.preparation.channels import Channel, remove_invalid_readings

SOME = dict(table_1_by_series()[::5])


def cautions_of(time, value):
    cautions = []
    remove_invalid_readings(Channel(time, value), "gauge", cautions)
    return [caution.code for caution in cautions]


@pytest.mark.parametrize("series", SOME)
@pytest.mark.parametrize(("rate_hz", "duration_s"), [(200.0, 40.0), (1000.0, 10.0), (5000.0, 10.0)])
def test_computed_readings_have_no_faults(series, rate_hz, duration_s):
    time, table, relative = simulate_readings(
        SOME[series].replace(noise_m=0.0, rate_hz=rate_hz, duration_s=duration_s)
    )

    assert cautions_of(time, table) == []
    assert cautions_of(time, relative) == []


@pytest.mark.parametrize(("step_m", "noise_m"), [(1e-5, 0.0), (1e-5, 5e-6), (2e-5, 0.0)])
@pytest.mark.parametrize("rate_hz", [200.0, 1000.0])
def test_a_coarse_converter_at_rest_is_not_stuck(step_m, noise_m, rate_hz):
    for friction in (0.057, 0.126, 0.153):
        time, table, relative = simulate_readings(
            Truth(friction_dynamic=friction, step_m=step_m, noise_m=noise_m, rate_hz=rate_hz, duration_s=5.0)
        )

        assert cautions_of(time, table) == []
        assert cautions_of(time, relative) == []


@pytest.mark.parametrize("noise_m", [0.0, 5e-6, 5e-5])
@pytest.mark.parametrize("rate_hz", [200.0, 1000.0, 5000.0])
def test_readings_beside_gaps_have_no_faults(noise_m, rate_hz):
    rng = np.random.default_rng(4)
    time, table, relative = simulate_readings(Truth(noise_m=noise_m, rate_hz=rate_hz, friction_static=0.15))
    kept = rng.random(len(time)) > 0.05
    for start_s in rng.uniform(0.0, 10.0, 12):
        kept &= (time < start_s) | (time > start_s + rng.uniform(0.005, 0.3))

    assert cautions_of(time[kept], table[kept]) == []
    assert cautions_of(time[kept], relative[kept]) == []


@pytest.mark.parametrize("noise_m", [0.0, 2e-5])
def test_spikes_at_uneven_times_are_found(noise_m):
    rng = np.random.default_rng(6)
    time, table, _ = simulate_readings(Truth(noise_m=noise_m))
    kept = rng.random(len(time)) > 0.1
    time, table = time[kept], table[kept].copy()
    spiked = rng.choice(len(time) - 100, 12, replace=False) + 50
    table[spiked] += rng.choice([-1.0, 1.0], 12) * rng.uniform(5e-4, 5e-3, 12)
    cautions = []

    left = remove_invalid_readings(Channel(time, table), "gauge", cautions)

    assert [caution.code for caution in cautions] == ["spikes"]
    assert len(time) - 15 <= len(left) <= len(time) - 12
    assert not np.isin(time[spiked], left.time_s).any()


@pytest.mark.parametrize("noise_m", [0.0, 2e-5])
def test_a_stuck_stretch_is_left_out(noise_m):
    time, table, _ = simulate_readings(Truth(noise_m=noise_m))
    stuck = (time > 2.31) & (time < 2.4)
    table = np.where(stuck, table[np.argmax(stuck)], table)
    cautions = []

    left = remove_invalid_readings(Channel(time, table), "gauge", cautions)

    assert [caution.code for caution in cautions] == ["frozen"]
    assert not np.isin(time[stuck][1:], left.time_s).any()
    assert len(left) == len(time) - stuck.sum()
