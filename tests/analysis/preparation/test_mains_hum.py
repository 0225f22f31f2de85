"""Mains hum is found where it is, and motion is not taken for it."""

import numpy as np
import pytest
from synthetic import Truth, simulate_readings

from analysis.identify import identify
from analysis.preparation.channels import Channel, detect_hum
from analysis.preparation.oscillation import find_releases
from analysis.record import Record, StandMasses


def humming(truth, frequency_hz, amplitude_m):
    time, table, relative = simulate_readings(truth)
    hum = amplitude_m * np.sin(2.0 * np.pi * frequency_hz * time + 0.7)
    return time, table + hum, relative


@pytest.mark.parametrize("rate_hz", [250.0, 1000.0, 5000.0])
@pytest.mark.parametrize("frequency_hz", [50.0, 60.0])
def test_frequency_and_amplitude_of_hum(rate_hz, frequency_hz):
    time, table, _ = humming(Truth(rate_hz=rate_hz, duration_s=5.0), frequency_hz, 8e-5)

    found = detect_hum(Channel(time, table))

    assert found[0] == frequency_hz
    assert found[1] == pytest.approx(8e-5, rel=0.2)


@pytest.mark.parametrize("rate_hz", [200.0, 1000.0, 5000.0])
@pytest.mark.parametrize("noise_m", [0.0, 2e-5, 1e-4])
def test_motion_and_noise_are_no_hum(rate_hz, noise_m):
    time, table, relative = simulate_readings(Truth(rate_hz=rate_hz, noise_m=noise_m, friction_static=0.2))

    assert detect_hum(Channel(time, table)) is None
    assert detect_hum(Channel(time, relative)) is None


@pytest.mark.parametrize("frequency_hz", [50.0, 60.0])
@pytest.mark.parametrize("amplitude_m", [5e-5, 1e-4, 5e-4])
def test_the_release_is_found_under_hum(frequency_hz, amplitude_m):
    time, table, _ = humming(Truth(pullback_m=0.006, noise_m=5e-6), frequency_hz, amplitude_m)

    (release,) = find_releases(Channel(time, table))

    assert release.plateau_start_s is not None
    assert release.time_s == pytest.approx(1.0, abs=0.02)


def test_hum_is_said_and_friction_found_within_its_uncertainty():
    time, table, relative = humming(Truth(), 50.0, 4e-4)

    found = identify(Record(time, table, relative, StandMasses(131.6, 22.4)))
    friction = found.results["friction_dynamic"]

    assert "mains-hum" in [caution.code for caution in found.warnings]
    assert friction.value == pytest.approx(0.1, rel=0.01)
    assert abs(friction.value - 0.1) < 4.0 * friction.standard_uncertainty
