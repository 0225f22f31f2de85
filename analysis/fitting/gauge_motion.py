"""Compiled description of what a gauge reads in a phase: a combination of a few functions of time.

Within a phase both displacements are combinations of 1, C = e^(-n tau) cos w tau, S = e^(-n tau) sin w tau,
tau and tau^2, and their derivatives by every parameter of these, tau C and tau S. `which` is 0 for gauge 1,
1 for gauge 2 against the table, 2 for gauge 2 against the base.
"""

from analysis.arrays import Floats
from analysis.compiled import compiled_part
from analysis.fitting.models import Parameter
from analysis.motion.events import RELATIVE, SIGN, TABLE, VELOCITY, oscillation_amplitudes, oscillator

# The residual, and the functions whose combinations all displacements are.
RESIDUAL, ONE, COS, SIN, TAU_COS, TAU_SIN, TAU, TAU_2 = range(8)
BASIS_SIZE = 8
# How many of them it takes where nothing moves, where the gauge swings, and where the plate slips.
CONSTANT, SWING, SLIP = 2, 6, 8

_TABLE_OFFSET, _TABLE_GAIN = int(Parameter.TABLE_OFFSET), int(Parameter.TABLE_GAIN)
_RELATIVE_OFFSET, _RELATIVE_GAIN = int(Parameter.RELATIVE_OFFSET), int(Parameter.RELATIVE_GAIN)
_LAG = int(Parameter.LAG)


@compiled_part
def gauge_response(point: Floats, which: int) -> tuple[float, float, float]:
    """Zero (m), gain and lateness (s) of a gauge at a point of the fit."""
    if which == 0:
        return point[_TABLE_OFFSET], 1.0 + point[_TABLE_GAIN], 0.0
    return point[_RELATIVE_OFFSET], 1.0 + point[_RELATIVE_GAIN], point[_LAG]


@compiled_part
def basis_size(sign: float, which: int) -> int:
    """How many of the functions a gauge takes in a phase with this sign."""
    if sign == 0.0:
        return CONSTANT if which == 1 else SWING
    return SWING if which == 0 else SLIP


@compiled_part
def displacement_coefficients(
    parameters: Floats, phase: Floats, which: int, motion: Floats
) -> tuple[float, float, float]:
    """Write the coefficients of the displacement in a phase into `motion` (8,).

    Returns
    -------
    float
        The share of u1 in it, but for that of u2 where the plate slips.
    float
        1 where u2 - u1 is in it.
    float
        1 where that slips.
    """
    sign, position, velocity = phase[SIGN], phase[TABLE], phase[VELOCITY]
    damping, frequency, load, drive = oscillator(parameters, sign)
    cosine, sine, _, _ = oscillation_amplitudes(damping, frequency, position - load, velocity)
    plate = 0.0 if which == 0 else 1.0
    slips = plate if sign != 0.0 else 0.0
    swings = (1.0 if which != 1 else 0.0) - slips  # where the plate slips it does not swing
    motion[ONE] = swings * load + plate * phase[RELATIVE] + slips * position
    motion[COS], motion[SIN] = swings * cosine, swings * sine
    motion[TAU], motion[TAU_2] = slips * velocity, slips * 0.5 * drive
    return swings, plate, slips
