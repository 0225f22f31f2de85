"""Free decay of one mass without sliding: period and damping of the stick tail."""

from dataclasses import dataclass

import numpy as np

from analysis.arrays import Floats
from analysis.formatting import format_number
from analysis.preparation.channels import Channel
from analysis.record import RecordError

_DECAY, _FREQUENCY, _COSINE, _SINE, _OFFSET = range(5)


@dataclass(frozen=True, eq=False, slots=True)
class DampedCosine:
    """Damped cosine  offset + exp(-n tau) (a cos w tau + b sin w tau),  tau = t - start_s.

    Attributes
    ----------
    start_s, end_s : float
        Stretch of the record that was fitted.
    parameters : (5,) float64
        n (1/s), damped w (rad/s), a, b, offset (m).
    covariance : (5, 5) float64
        From the residual, type A.
    residual_m : (n,) float64
        Reading minus curve.
    """

    start_s: float
    end_s: float
    parameters: Floats
    covariance: Floats
    residual_m: Floats

    @property
    def damping_per_s(self) -> float:
        """Decay constant n of the envelope."""
        return float(self.parameters[_DECAY])

    @property
    def period_s(self) -> float:
        """Damped period."""
        return 2.0 * np.pi / float(self.parameters[_FREQUENCY])

    @property
    def offset_m(self) -> float:
        """Rest position of the gauge."""
        return float(self.parameters[_OFFSET])

    @property
    def amplitude_m(self) -> float:
        """Amplitude at `start_s`."""
        return float(np.hypot(self.parameters[_COSINE], self.parameters[_SINE]))

    @property
    def periods(self) -> float:
        """Length of the fitted stretch in periods."""
        return (self.end_s - self.start_s) / self.period_s

    @property
    def rms_m(self) -> float:
        """Root mean square of the residual."""
        return float(np.sqrt(np.mean(self.residual_m**2)))

    @property
    def period_uncertainty_s(self) -> float:
        """Standard uncertainty of the period from the residual."""
        w = self.parameters[_FREQUENCY]
        return float(2.0 * np.pi / w**2 * np.sqrt(self.covariance[_FREQUENCY, _FREQUENCY]))

    @property
    def damping_uncertainty_per_s(self) -> float:
        """Standard uncertainty of n from the residual."""
        return float(np.sqrt(self.covariance[_DECAY, _DECAY]))


def dominant_period(channel: Channel) -> float:
    """Period (s) of the strongest oscillation, from a Hann-windowed spectrum; a few per cent.

    Raises
    ------
    RecordError
        When no oscillation of at least two cycles stands out.
    """
    count = int(np.clip(len(channel), 256, 8192))
    t = np.linspace(channel.time_s[0], channel.time_s[-1], count)
    x = np.interp(t, channel.time_s, channel.value_m)
    x = (x - x.mean()) * np.hanning(count)
    power = np.abs(np.fft.rfft(x, 4 * count)) ** 2
    first = 5
    peak = first + int(np.argmax(power[first:-1]))
    if peak <= first or power[peak] <= 0.0:
        raise RecordError(
            "no oscillation found in {length_s} s of gauge 1. Record a free decay of some periods.",
            length_s=format_number(t[-1] - t[0]),
        )
    below, top, above = np.log(power[peak - 1 : peak + 2] + 1e-300)
    shift = 0.5 * (below - above) / (below - 2.0 * top + above)
    return float(4 * count * (t[1] - t[0]) / (peak + shift))


def fit_damped_cosine(channel: Channel, period_s: float) -> DampedCosine:
    """Fit a damped cosine with offset by least squares, over two periods first and then over twice as many.

    Parameters
    ----------
    channel : Channel
        At least a period of free decay.
    period_s : float
        Period to start from, within a tenth.

    Raises
    ------
    RecordError
        When the channel is shorter than a period or holds fewer than ten readings.
    """
    length_s = float(channel.time_s[-1] - channel.time_s[0]) if len(channel) else 0.0
    if len(channel) < 10 or length_s < period_s:
        raise RecordError(
            "a decay of {length_s} s is shorter than its period. Record longer.",
            length_s=format_number(length_s),
        )
    shape = np.array([0.1, 2.0 * np.pi / period_s])
    stretch_s = 2.0 * period_s
    while True:
        part = channel.between(channel.time_s[0], channel.time_s[0] + stretch_s)
        parameters = _refine(part, shape)
        shape = parameters[:2]
        if stretch_s > length_s:
            break
        stretch_s *= 2.0
    return _finished(channel, parameters)


def refit_damped_cosine(channel: Channel, before: DampedCosine) -> DampedCosine:
    """Fit a channel that begins where an earlier fit began and has grown since."""
    return _finished(channel, _refine(channel, before.parameters[:2]))


def envelope_curvature(channel: Channel, decay: DampedCosine) -> float:
    """How far the log of the envelope bends, in standard deviations of the noise; negative for dry friction.

    The significance of q in an envelope exp(-n tau + q tau^2), from one step of least squares.
    """
    tau = channel.time_s - decay.start_s
    curve, columns = damped_cosine(decay.parameters, tau)
    rows = np.vstack((columns, tau**2 * (curve - decay.offset_m)))
    scale = np.sqrt(np.sum(rows**2, axis=1))
    rows = rows / scale[:, None]
    inverse = np.linalg.inv(rows @ rows.T)
    if not inverse[-1, -1] > 0.0:  # the tail is too short to tell a bend from damping
        return 0.0
    bend = inverse @ (rows @ decay.residual_m)
    return float(bend[-1] / np.sqrt(inverse[-1, -1])) / max(decay.rms_m, 1e-12)


def damped_cosine(parameters: Floats, tau_s: Floats) -> tuple[Floats, Floats]:
    """Curve (n,) and its derivatives (5, n) by the parameters of `Decay`."""
    n, w, a, b, offset = parameters
    envelope = np.exp(-n * tau_s)
    cosine, sine = envelope * np.cos(w * tau_s), envelope * np.sin(w * tau_s)
    swing = a * cosine + b * sine
    by_w = tau_s * (b * cosine - a * sine)
    return offset + swing, np.stack((-tau_s * swing, by_w, cosine, sine, np.ones_like(tau_s)))


def _refine(channel: Channel, shape: Floats) -> Floats:
    """Gauss-Newton from the decay constant and frequency in `shape`; the rest is linear."""
    tau = channel.time_s - channel.time_s[0]
    x = channel.value_m
    parameters = np.concatenate((shape, np.zeros(3)))
    _, columns = damped_cosine(parameters, tau)
    parameters[2:] = np.linalg.lstsq(columns[2:].T, x, rcond=None)[0]
    cost = np.inf
    for _ in range(30):
        curve, columns = damped_cosine(parameters, tau)
        residual = x - curve
        before, cost = cost, float(residual @ residual)
        step = np.linalg.lstsq(columns @ columns.T, columns @ residual, rcond=1e-14)[0]
        step[:2] = np.clip(step[:2], -0.05 * parameters[1], 0.05 * parameters[1])
        parameters = parameters + step
        if abs(before - cost) <= 1e-10 * cost:
            break
    return np.asarray(parameters)


def _finished(channel: Channel, parameters: Floats) -> DampedCosine:
    tau = channel.time_s - channel.time_s[0]
    curve, columns = damped_cosine(parameters, tau)
    residual = channel.value_m - curve
    variance = float(residual @ residual) / max(1, len(tau) - 5)
    try:
        covariance = np.asarray(variance * np.linalg.inv(columns @ columns.T), dtype=np.float64)
    except np.linalg.LinAlgError:
        raise RecordError(
            "{length_s} s of gauge 1 show no free decay: no damped cosine fits. Record a free decay"
            " of some periods.",
            length_s=format_number(tau[-1]),
        ) from None
    return DampedCosine(float(channel.time_s[0]), float(channel.time_s[-1]), parameters, covariance, residual)
