"""The parameter vector of a fit: what every model of the stand has, then what single friction laws add."""

from dataclasses import dataclass
from enum import IntEnum


class Parameter(IntEnum):
    """Places in the parameter vector of a fit (SI); those of the motion come first."""

    FRICTION_DYNAMIC = 0
    FRICTION_STATIC = 1
    STIFFNESS = 2
    DAMPING = 3
    PULLBACK = 4
    TILT = 5
    RELEASE = 6
    TABLE_MASS = 7
    PLATE_MASS = 8
    GRAVITY = 9
    TABLE_OFFSET = 10
    RELATIVE_OFFSET = 11
    TABLE_GAIN = 12  # relative error of gauge 1's gain
    RELATIVE_GAIN = 13
    LAG = 14  # delay of gauge 2 against gauge 1 beyond the known one (s)


MOTION_PARAMETER_COUNT = 10
"""Parameters of the motion that all laws have; the kernels of `analysis.motion` take them in this order."""
SHARED_PARAMETER_COUNT = len(Parameter)  # the parameters of the laws' own follow from this place on


@dataclass(frozen=True, slots=True)
class OwnParameter:
    """A parameter that one friction law adds."""

    name: str  # key in results and in saved parameters, with its unit
    unit: str
    default: float  # value in the vector of a law that does not use it
    lower: float  # lower bound of a fit; `upper` is the other
    upper: float


PERIOD_MIN_S, PERIOD_MAX_S = 0.03, 10.0
"""Stands of a few kilograms to some tonnes on elastic plates swing with periods in between."""
FRICTION_MAX = 2.0
"""No dry plates have a larger coefficient of friction; clean metal that seizes comes near it."""
TILT_MAX_RAD = 0.02
"""A plane is levelled to 2 mrad (`analysis.uncertainty`); a tenfold tilt is seen by eye."""
TRAVEL_MAX_M = 0.5  # no stand for dry friction on a table moves so far: readings that do are in another unit
