"""The closed form of the one-mass decay against DOP853, its half-cycle rule and hand-worked cases."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from analysis.motion.one_mass import DecayError, OneMassDecay, free_decay, simulate


def undamped_frequency(decay: OneMassDecay) -> float:
    return math.hypot(2.0 * math.pi / decay.period_s, decay.damping_n_per_s)


def decay_from_state(
    displacement_m: float,
    velocity_m_per_s: float,
    *,
    period_s: float,
    damping_n_per_s: float,
    coulomb_displacement_m: float = 0.0,
) -> OneMassDecay:
    """Free decay that has this displacement (m) and velocity (m/s) at time 0.

    A mass that moves at time 0 is given by the turning point it would have come from.
    """
    at_rest = OneMassDecay(period_s, damping_n_per_s, coulomb_displacement_m, 0.0, displacement_m)
    if velocity_m_per_s == 0.0:
        return at_rest
    omega, n = 2.0 * math.pi / period_s, damping_n_per_s
    direction = math.copysign(1.0, velocity_m_per_s)
    x = displacement_m + direction * coulomb_displacement_m
    y = (velocity_m_per_s + n * x) / omega
    k2 = omega**2 + n**2
    phase = math.atan2(direction * velocity_m_per_s, -direction * (k2 * x + n * velocity_m_per_s) / omega)
    since_s = phase / omega
    amplitude = math.exp(n * since_s) * math.hypot(x, y) / math.hypot(1.0, n / omega)
    turning_m = -direction * (amplitude + coulomb_displacement_m)
    return OneMassDecay(period_s, n, coulomb_displacement_m, -since_s, turning_m)


def integrate(u0, v0, k, n, x_k, times):
    """DOP853 from event to event: velocity zero ends a half cycle; inside |u| < x_k it stays."""
    out = np.empty((2, times.size))
    t, state = 0.0, np.array([u0, v0])
    while True:
        if state[1] == 0.0 and abs(state[0]) <= x_k:
            out[:, times >= t] = [[state[0]], [0.0]]
            return out
        s = math.copysign(1.0, state[1]) if state[1] else -math.copysign(1.0, state[0])

        def right(_, y, s=s):
            return [y[1], -2 * n * y[1] - k * k * (y[0] + s * x_k)]

        def turned(tt, y, s=s, t=t):
            return y[1] if tt > t else s

        turned.terminal, turned.direction = True, -s
        run = solve_ivp(right, (t, times[-1] + 10.0 / k), state, "DOP853", events=turned,
                        rtol=3e-14, atol=1e-17, dense_output=True, max_step=0.5 / k)  # fmt: skip
        end = run.t[-1]
        inside = (times >= t) & (times <= end)
        # The dense output is of lower order than the steps: integrate to each sample instead.
        out[:, inside] = _at(right, t, state, times[inside], k)
        if end > times[-1]:
            return out
        t, state = end, np.array([run.y[0, -1], 0.0])


def _at(right, t, state, times, k):
    states = []
    for time in times:
        if time > t:
            state = solve_ivp(right, (t, time), state, "DOP853", rtol=3e-14, atol=1e-17, max_step=0.5 / k).y[
                :, -1
            ]
            t = time
        states.append(state)
    return np.array(states).T.reshape(2, -1)


@pytest.mark.parametrize(
    ("u0", "v0", "n", "x_k"),
    [
        (0.012, 0.0, 0.12, 0.0),
        (0.012, 0.0, 0.12, 0.00012),
        (-0.012, 0.0, 0.3, 0.0009),
        (0.001, 0.15, 0.2, 0.0004),
        (0.003, -0.2, 0.0, 0.0005),
        (0.0001, 0.01, 5.0, 0.0002),
    ],
)
def test_agrees_with_dop853(u0, v0, n, x_k):
    period = 0.32
    times = np.linspace(0.0, 4.0, 60)
    decay = decay_from_state(u0, v0, period_s=period, damping_n_per_s=n, coulomb_displacement_m=x_k)
    motion = simulate(decay, times)
    reference = integrate(u0, v0, undamped_frequency(decay), n, x_k, times)
    assert np.abs(motion.displacement_m - reference[0]).max() < 1e-12
    assert np.abs(motion.velocity_m_per_s - reference[1]).max() < 2e-11


def test_agrees_with_equation_of_motion():
    decay = OneMassDecay(0.32, 0.4, 0.0003, 0.0, 0.012)
    t = np.linspace(0.001, 2.0, 4001)
    motion = simulate(decay, t)
    k, n, x_k = undamped_frequency(decay), 0.4, 0.0003
    force = motion.acceleration_m_per_s2 + 2 * n * motion.velocity_m_per_s + k**2 * motion.displacement_m
    moving = np.abs(motion.velocity_m_per_s) > 0.0
    wanted = -(k**2) * x_k * np.sign(motion.velocity_m_per_s)
    assert moving.sum() > 3900
    np.testing.assert_allclose(force[moving], wanted[moving], atol=1e-10)


def test_stops_off_zero_inside_the_rest_band():
    # Without viscous damping each half cycle takes 2 x_k: 10 -> 7 -> 4 -> 1 and there it stays.
    motion = simulate(OneMassDecay(2.0, 0.0, 1.5, 0.0, 10.0), np.array([0.0, 1.0, 2.0, 3.0, 50.0]))
    np.testing.assert_allclose(motion.displacement_m, [10.0, -7.0, 4.0, -1.0, -1.0], rtol=1e-15)
    assert motion.stop_s == pytest.approx(3.0)
    assert motion.turning_m.tolist() == [10.0, -7.0, 4.0, -1.0]
    assert motion.velocity_m_per_s[-1] == 0.0
    assert motion.acceleration_m_per_s2[-1] == 0.0


def test_released_inside_the_rest_band_stays():
    motion = simulate(OneMassDecay(1.0, 0.1, 0.01, 0.0, -0.004), np.array([0.0, 0.3, 9.0]))
    assert motion.displacement_m.tolist() == [-0.004] * 3
    assert motion.stop_s == 0.0


def test_still_moving_has_no_stop():
    assert simulate(OneMassDecay(1.0, 0.1, 0.001, 0.0, 1.0), np.array([2.0])).stop_s is None


@given(
    period=st.floats(0.01, 10.0),
    ratio=st.floats(0.0, 0.9),
    x_k=st.floats(1e-6, 0.3),
    side=st.sampled_from([-1.0, 1.0]),
)
def test_turning_points_keep_the_half_cycle_rule(period, ratio, x_k, side):
    n = ratio * 2 * math.pi / period
    motion = simulate(OneMassDecay(period, n, x_k, 0.3, side), np.array([0.3 + 200 * period]))
    b = math.exp(-n * period / 2)
    size = np.abs(motion.turning_m)
    np.testing.assert_allclose(size[1:], np.abs(b * size[:-1] - (1 + b) * x_k), atol=1e-12)
    assert (size[:-1] > x_k).all()
    assert motion.stop_s is None or size[-1] <= x_k
    seen = simulate(OneMassDecay(period, n, x_k, 0.3, side), motion.turning_s).displacement_m
    np.testing.assert_allclose(seen, motion.turning_m, atol=1e-11)


@settings(max_examples=200)
@given(
    u0=st.floats(-1.0, 1.0),
    v0=st.floats(-10.0, 10.0).filter(lambda v: v == 0.0 or abs(v) > 1e-6),
    period=st.floats(0.05, 5.0),
    ratio=st.floats(0.0, 0.9),
    x_k=st.floats(0.0, 0.5),
)
def test_start_has_the_given_state(u0, v0, period, ratio, x_k):
    n = ratio * 2 * math.pi / period
    decay = decay_from_state(u0, v0, period_s=period, damping_n_per_s=n, coulomb_displacement_m=x_k)
    motion = simulate(decay, np.array([0.0]))
    scale = (abs(u0) + x_k) * undamped_frequency(decay) + abs(v0)
    assert motion.displacement_m[0] == pytest.approx(u0, abs=1e-12 * max(1.0, scale))
    assert motion.velocity_m_per_s[0] == pytest.approx(v0, abs=1e-11 * max(1.0, scale))


@given(
    ratio=st.floats(0.0, 0.3),
    x_k=st.floats(0.0, 0.02),
    back=st.integers(1, 6),
)
def test_any_turning_point_describes_the_same_decay(ratio, x_k, back):
    n = ratio * 2 * math.pi
    late = OneMassDecay(1.0, n, x_k, 3.0, 1.0)
    earlier_s = 3.0 - 0.5 * back
    start_m = simulate(late, np.array([earlier_s + 1e-13])).displacement_m[0]
    early = OneMassDecay(1.0, n, x_k, earlier_s, start_m)
    times = np.linspace(earlier_s + 0.01, 8.0, 100)
    np.testing.assert_allclose(simulate(early, times).displacement_m, simulate(late, times).displacement_m,
                               atol=1e-9 * abs(early.turning_m))  # fmt: skip


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("which", range(5))
def test_complex_steps_give_the_derivative(order, which):
    times = np.linspace(0.05, 3.0, 37)
    values = [0.01, -1.0, 9.0, 0.2, 0.03]
    stepped = [complex(v) for v in values]
    stepped[which] += 1e-30j
    exact = free_decay(times, *stepped, order=order).imag / 1e-30
    up, down = list(values), list(values)
    up[which] += 1e-6
    down[which] -= 1e-6
    plain = (free_decay(times, *up, order=order) - free_decay(times, *down, order=order)) / 2e-6
    np.testing.assert_allclose(exact, plain, atol=1e-5 * np.abs(plain).max() + 1e-9)


@pytest.mark.parametrize(
    ("name", "value"),
    [("period_s", 0.0), ("period_s", math.nan), ("damping_n_per_s", -0.1), ("coulomb_displacement_m", -1.0),
     ("turning_m", math.inf)],
)  # fmt: skip
def test_impossible_parameters_are_named(name, value):
    good = {
        "period_s": 1.0,
        "damping_n_per_s": 0.1,
        "coulomb_displacement_m": 0.0,
        "turning_s": 0.0,
        "turning_m": 1.0,
    }
    with pytest.raises(DecayError, match=name):
        OneMassDecay(**(good | {name: value}))
