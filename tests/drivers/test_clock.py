import numpy as np
import pytest

from drivers.clock import ClockFit, rate_from_steps

RATE_HZ = 500.0
SECOND_NS = 1_000_000_000


def arrivals_s(rng: np.random.Generator, span_s: float, rate_hz: float, kind: str) -> np.ndarray:
    """When the host sees every second sample, by three kinds of delay."""
    sent_s = np.arange(1, int(span_s * rate_hz), 2) / rate_hz
    delay_s = 2e-3 + rng.exponential(3e-4, len(sent_s))
    if kind == "stalls":
        delay_s += (rng.random(len(sent_s)) < 0.02) * rng.exponential(0.03, len(sent_s))
    if kind == "usb":
        delay_s += np.ceil(sent_s / 1e-3) * 1e-3 - sent_s
    return np.maximum.accumulate(sent_s + delay_s)


def fitted(rng: np.random.Generator, span_s: float, ppm: float, kind: str):
    true_hz = RATE_HZ * (1 + ppm * 1e-6)
    fit = ClockFit(RATE_HZ)
    for k, arrival_s in enumerate(arrivals_s(rng, span_s, true_hz, kind)):
        fit.add(2 * k + 1, int(arrival_s * SECOND_NS) + 77 * SECOND_NS)
    estimate = fit.estimate()
    error = estimate.rate_hz / true_hz - 1
    assert estimate.scale == pytest.approx(RATE_HZ / estimate.rate_hz, rel=1e-12)
    return error, estimate.scale_standard_uncertainty, estimate.span_s


@pytest.mark.parametrize(("kind", "limit"), [("scheduling", 5e-6), ("stalls", 5e-6), ("usb", 55e-6)])
@pytest.mark.parametrize("ppm", [-200.0, 0.0, 30.0, 4000.0])
def test_ten_seconds_are_good_to_fifty_ppm_at_worst(kind, limit, ppm):
    rng = np.random.default_rng(11)
    errors, uncertainties, spans_s = np.array([fitted(rng, 10, ppm, kind) for _ in range(20)]).T
    assert np.sqrt((errors**2).mean()) < limit
    assert np.all(uncertainties < 50e-6)
    # The uncertainty covers the error also where a slow beat with the host's clock hides the drift.
    assert np.mean(np.abs(errors) < 2 * uncertainties) >= 0.95
    np.testing.assert_allclose(spans_s, 10, atol=0.5)


@pytest.mark.parametrize("span_s", [7.0, 20.0])
def test_a_starved_host_is_not_believed_too_much(span_s):
    """Lateness that wanders, as on a machine with too much to do: its drift looks like a wrong clock."""
    off = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        fit, late_s = ClockFit(RATE_HZ), 0.0
        for k in range(0, int(span_s * RATE_HZ), 5):
            late_s = max(0.0, late_s + rng.normal(0.0, 0.02) - 0.05 * late_s * 5 / RATE_HZ)
            fit.add(k, int((k / RATE_HZ + late_s) * SECOND_NS))
        estimate = fit.estimate()
        off.append(abs(estimate.scale - 1.0) / estimate.scale_standard_uncertainty)
    assert np.mean(np.array(off) > 6.0) < 0.1


def test_longer_is_better():
    rng = np.random.default_rng(5)
    errors, uncertainties, _ = np.array([fitted(rng, 60, 30.0, "usb") for _ in range(5)]).T
    assert np.all(np.abs(errors) < 2 * uncertainties)
    assert np.all(uncertainties < 1e-5)


def test_a_whole_late_stretch_is_left_out():
    fit = ClockFit(RATE_HZ)
    for k in range(5000):
        late_s = 0.5 if 2000 <= k < 2240 else 0.0
        fit.add(k, int((k / RATE_HZ + late_s) * SECOND_NS))
    assert fit.estimate().rate_hz == pytest.approx(RATE_HZ, rel=1e-6)


def test_an_hour_takes_no_more_memory_and_stays_right():
    fit = ClockFit(RATE_HZ)
    for k in range(0, int(3600 * RATE_HZ), 100):
        fit.add(k, int(k / (RATE_HZ * 1.00002) * SECOND_NS))
    assert fit.windows <= 512
    assert fit.estimate().rate_hz == pytest.approx(RATE_HZ * 1.00002, rel=1e-7)


def test_too_little_tells_no_rate():
    fit = ClockFit(RATE_HZ)
    assert fit.estimate() is None
    for k in range(300):
        fit.add(k, int(k / RATE_HZ * SECOND_NS))
    assert fit.estimate() is None


@pytest.mark.parametrize("odd_s", [0.02, 0.4, 5000.0, -3.0])
def test_the_rate_of_steps_leaves_out_odd_ones(odd_s):
    steps_s = np.full(200, 0.01)
    steps_s[50:190:20] = odd_s
    assert rate_from_steps(steps_s) == pytest.approx(100)


def test_a_coarse_clock_is_averaged():
    times_s = np.floor(np.arange(3000) / 3000 * 1000) / 1000  # 3 kHz in whole milliseconds
    assert rate_from_steps(np.diff(times_s), 1e-3) == pytest.approx(3000, rel=2e-3)


@pytest.mark.parametrize("steps_s", [[], [0.1] * 4, [0.01] * 40, [0.0] * 1000])
def test_too_few_steps_tell_no_rate(steps_s):
    assert rate_from_steps(np.array(steps_s)) is None
