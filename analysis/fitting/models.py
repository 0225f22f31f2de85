"""The friction laws that are tried, and the parameters that each leaves free."""

from enum import Enum, IntEnum


class Parameter(IntEnum):
    """Places in the parameter vector of a fit; the kernels' ten first, then that of Stribeck friction."""

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
    STRIBECK_VELOCITY = 10
    TABLE_OFFSET = 11
    RELATIVE_OFFSET = 12
    TABLE_GAIN = 13
    """Relative error of gauge 1's gain."""
    RELATIVE_GAIN = 14
    LAG = 15
    """Lateness of gauge 2 against gauge 1 beyond what is known (s)."""


MOTION_PARAMETER_COUNT = 10
"""Of the motion without Stribeck friction."""
STRIBECK_PARAMETER_COUNT = 11
DEFAULT_STRIBECK_VELOCITY_M_PER_S = 0.01
"""Kept in the parameters of laws that do not use it."""
PARAMETER_COUNT = len(Parameter)
COMMON_PARAMETERS = (
    Parameter.FRICTION_DYNAMIC,
    Parameter.STIFFNESS,
    Parameter.DAMPING,
    Parameter.PULLBACK,
    Parameter.RELEASE,
    Parameter.TABLE_OFFSET,
    Parameter.RELATIVE_OFFSET,
)


class FrictionLaw(Enum):
    """Friction laws, each holding the one before it as a special case."""

    COULOMB = "coulomb"
    COULOMB_TILT = "coulomb+tilt"
    STATIC = "static"
    STATIC_TILT = "static+tilt"
    STRIBECK_TILT = "stribeck+tilt"

    @property
    def has_tilt(self) -> bool:
        """Whether the tilt is a parameter."""
        return self in (FrictionLaw.COULOMB_TILT, FrictionLaw.STATIC_TILT, FrictionLaw.STRIBECK_TILT)

    @property
    def has_static_friction(self) -> bool:
        """Whether f_s is a parameter of its own."""
        return self in (FrictionLaw.STATIC, FrictionLaw.STATIC_TILT, FrictionLaw.STRIBECK_TILT)

    @property
    def free_parameters(self) -> tuple[Parameter, ...]:
        """Places that the model leaves free, calibration and masses aside."""
        own = (Parameter.FRICTION_STATIC,) * self.has_static_friction + (Parameter.TILT,) * self.has_tilt
        own += (Parameter.STRIBECK_VELOCITY,) * (self is FrictionLaw.STRIBECK_TILT)
        return tuple(sorted(COMMON_PARAMETERS + own))


COMPARED_LAWS = (FrictionLaw.COULOMB, FrictionLaw.COULOMB_TILT, FrictionLaw.STATIC, FrictionLaw.STATIC_TILT)
"""The laws that are always compared."""
