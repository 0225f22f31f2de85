"""Two oscillators that do not touch, as ranging sensors see them: no friction may be believed."""

import numpy as np
import pytest
from coupled_oscillators import coupled_oscillators
from synthetic import Truth, simulate_record

from analysis.identification import Degree
from analysis.identify import identify
from analysis.record import RecordError


@pytest.mark.parametrize(
    ("period_s", "frequency_ratio", "mass_ratio", "damping_ratio"),
    [(0.5, 0.7, 0.4, 0.02), (0.6, 0.8, 0.2, 0.05), (1.0, 0.9, 0.1, 0.05)],
)
def test_a_tuned_mass_damper_read_in_steps_is_no_crash(period_s, frequency_ratio, mass_ratio, damping_ratio):
    """Steps of 1 mm hide when the table began, and the release was sought 10^14 s away."""
    damper = coupled_oscillators(period_s, frequency_ratio, mass_ratio, (0.005, damping_ratio), step_m=1e-3)
    refusal, adequate = "", False
    try:
        found = identify(damper)
        adequate = found.model is not None and found.model.adequate
    except RecordError as error:
        refusal = str(error)
    assert not adequate
    assert "\n" not in refusal


def test_least_squares_without_a_solution_are_one_line(monkeypatch):
    def fail(*_):
        raise np.linalg.LinAlgError("Eigenvalues did not converge")

    monkeypatch.setattr("analysis.identify.build_problem", fail)
    with pytest.raises(RecordError, match=r"no law of motion .* \(Eigenvalues did not converge\)"):
        identify(simulate_record(Truth(rate_hz=200.0)))


@pytest.mark.parametrize(
    ("period_s", "frequency_ratio", "damping_ratio", "rate_hz", "hold_s"),
    [(0.84, 0.91, 0.018, 40.0, 0.0), (0.46, 0.9, 0.002, 50.0, 0.05)],
)
def test_no_friction_is_believed_between_two_carts(period_s, frequency_ratio, damping_ratio, rate_hz, hold_s):
    """Without contact the fit took f_d 0.7 with a tilt of 0.5 rad, or an f_d of 0.7 that may be 0.

    The records begin too late to show how the first cart was held.
    """
    found = identify(two_carts(period_s, frequency_ratio, damping_ratio, rate_hz, hold_s))
    assert not {"friction_dynamic", "friction_static", "friction_dynamic_plate"} & found.results.keys()
    assert "implausible-result" in [warning.code for warning in found.warnings]
    assert found.model.degree is Degree.NONE


@pytest.mark.parametrize(
    ("period_s", "frequency_ratio", "damping_ratio"), [(0.84, 0.91, 0.018), (0.46, 0.9, 0.002)]
)
@pytest.mark.parametrize("rate_hz", [30.0, 35.0, 60.0])
def test_no_friction_is_believed_between_two_carts_of_which_one_was_held(
    period_s, frequency_ratio, damping_ratio, rate_hz
):
    """Of the first an f_d is shown at some rates, beside the verdict that no model explains the record."""
    found = identify(two_carts(period_s, frequency_ratio, damping_ratio, rate_hz, hold_s=2.0))
    codes = [warning.code for warning in found.warnings]
    assert "model-inadequate" in codes
    assert "release-not-recorded" not in codes
    assert found.model.degree is Degree.NONE
    assert not found.model.adequate
    if period_s == 0.46:
        assert not {"friction_dynamic", "friction_static", "friction_dynamic_plate"} & found.results.keys()


def two_carts(period_s, frequency_ratio, damping_ratio, rate_hz, hold_s):
    """Record of two carts with nearly the same period, the second half as heavy as the first."""
    return coupled_oscillators(
        period_s,
        frequency_ratio,
        0.5,
        (damping_ratio, damping_ratio),
        between="walls",
        rate_hz=rate_hz,
        hold_s=hold_s,
        pullback_m=0.05,
        noise_m=1e-4,
    )


def test_no_slip_that_was_not_fitted_ends():
    """Gauge 2 moves until its swing dies, which was told as an end of slip beside "no slip was fitted"."""
    carts = coupled_oscillators(
        0.46, 0.7, 1.0, (0.011, 0.011), between="walls", hold_s=2.0, pullback_m=0.05, noise_m=5e-4
    )
    found = identify(carts)
    codes = [warning.code for warning in found.warnings]
    assert "friction-not-identified" in codes
    assert "tilt-not-identified" not in codes
    assert found.events.slip_end_s is None
