"""The friction laws that are tried, and the parameters that each leaves free."""

from enum import Enum, IntEnum


class Place(IntEnum):
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


MOTION_PARAMETERS = 10
"""Of the motion without Stribeck friction."""
STRIBECK_PARAMETERS = 11
STRIBECK_VELOCITY_M_PER_S = 0.01
"""Kept in the parameters of laws that do not use it."""
PARAMETERS = len(Place)
ALWAYS_FREE = (
    Place.FRICTION_DYNAMIC,
    Place.STIFFNESS,
    Place.DAMPING,
    Place.PULLBACK,
    Place.RELEASE,
    Place.TABLE_OFFSET,
    Place.RELATIVE_OFFSET,
)


class Model(Enum):
    """Friction laws, each holding the one before it as a special case."""

    COULOMB = "coulomb"
    COULOMB_TILT = "coulomb+tilt"
    STATIC = "static"
    STATIC_TILT = "static+tilt"
    STRIBECK_TILT = "stribeck+tilt"

    @property
    def has_tilt(self) -> bool:
        """Whether the tilt is a parameter."""
        return self in (Model.COULOMB_TILT, Model.STATIC_TILT, Model.STRIBECK_TILT)

    @property
    def has_static(self) -> bool:
        """Whether f_s is a parameter of its own."""
        return self in (Model.STATIC, Model.STATIC_TILT, Model.STRIBECK_TILT)

    @property
    def free(self) -> tuple[Place, ...]:
        """Places that the model leaves free, calibration and masses aside."""
        own = (Place.FRICTION_STATIC,) * self.has_static + (Place.TILT,) * self.has_tilt
        own += (Place.STRIBECK_VELOCITY,) * (self is Model.STRIBECK_TILT)
        return tuple(sorted(ALWAYS_FREE + own))


BY_LIKELIHOOD = (Model.COULOMB, Model.COULOMB_TILT, Model.STATIC, Model.STATIC_TILT)
"""The laws that are always compared."""
