"""A steady oscillation beside a decay of one mass, as a drive that was left on makes it.

At its own frequency a drive changes the swing and the phase slowly, as a spring and damping of another law
do: halves of the record may then agree on a wrong period and damping.
"""

import math
from dataclasses import dataclass

import numpy as np

from analysis.arrays import Floats
from analysis.one_mass.fit import OneMassFit
from analysis.one_mass.residuals import assess_residuals
from analysis.preparation.channels import Channel

_READINGS_MAX = 1500  # of a record that are fitted: its period and its envelope need no more
_BEATS = (-1.0, 0.0, 1.0)  # of the drive with the decay over the record, from which its frequency is searched
_FADING = 2.0  # damping over the length of the record, from which that of the decay is searched
_TRIALS_MAX = 40
_BAND = (0.5, 2.0)  # of the decay's frequency: a drive beyond it shows as a second mode
_PARAMETERS = 3  # more than those of the decay: swing, phase and frequency of the drive
_EVIDENCE = 10.0  # fall of BIC that is very strong evidence (Kass and Raftery 1995)


@dataclass(frozen=True, slots=True)
class SteadyDrive:
    """Steady sine beside a decay."""

    frequency_hz: float
    amplitude: float  # in the unit of the readings


def find_drive(readings: Channel, found: OneMassFit, step: float) -> SteadyDrive | None:
    """Find the steady sine that explains what the decay `found` leaves of `readings`, rounded to `step`.

    `readings` begin with those fitted and may go on beyond them: a drive does not stop. None where a decay
    with viscous damping beside a steady sine does not leave noise.
    """
    stride = -(-len(readings) // _READINGS_MAX)
    thinned = Channel(readings.time_s[::stride], readings.value_m[::stride])
    drive, residual = _fit(thinned, found.parameters.omega_rad_per_s)
    ratio = math.sqrt(float(np.mean(residual**2))) / max(found.rms, 1e-300)
    interval_s = float(np.median(np.diff(thinned.time_s)))
    effective = len(thinned) / found.noise_factor
    gains = -2.0 * effective * math.log(ratio) > _PARAMETERS * math.log(effective) + _EVIDENCE
    swing = float(np.ptp(thinned.value_m))
    return drive if gains and assess_residuals(residual, interval_s, step, swing).adequate else None


def _fit(readings: Channel, omega: float) -> tuple[SteadyDrive, Floats]:
    """Least squares of decay and steady sine, both of about `omega` (rad/s), and its residual (n,)."""
    from scipy.optimize import least_squares  # late: as in `analysis.one_mass.fit`

    since_s = readings.time_s - readings.time_s[0]
    length_s = float(since_s[-1])
    least, most = (share * omega * length_s for share in _BAND)

    def project(rates: Floats) -> tuple[Floats, Floats]:
        """Best amplitudes (5,) for damping, frequency and frequency of the drive, and the residual (n,)."""
        fading, own = np.exp(-rates[0] * since_s), rates[1] * since_s
        driven = rates[2] * since_s
        waves = (fading * np.cos(own), fading * np.sin(own), np.cos(driven), np.sin(driven))
        columns = np.stack((np.ones_like(since_s), *waves))
        amplitudes = np.linalg.lstsq(columns @ columns.T, columns @ readings.value_m, rcond=1e-12)[0]
        return amplitudes, readings.value_m - amplitudes @ columns

    def misfit(rates: Floats) -> Floats:
        return project(rates / length_s)[1]

    found = [
        least_squares(
            misfit,
            [_FADING, omega * length_s, omega * length_s + 2.0 * math.pi * beats],
            bounds=([0.0, least, least], [omega * length_s, most, most]),
            max_nfev=_TRIALS_MAX,
        )
        for beats in _BEATS
    ]
    rates = min(found, key=lambda one: float(one.cost)).x / length_s
    amplitudes, residual = project(rates)
    return SteadyDrive(float(rates[2]) / 2.0 / math.pi, float(np.hypot(*amplitudes[3:]))), residual
