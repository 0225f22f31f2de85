"""The friction laws that an identification can use. A new law is a file of its own and one line here."""

from dataclasses import replace

import numpy as np

from analysis.arrays import Floats
from analysis.laws.coulomb import COULOMB, COULOMB_TILT, STATIC, STATIC_TILT
from analysis.laws.law import FrictionLaw
from analysis.laws.parameters import SHARED_PARAMETER_COUNT, Parameter
from analysis.laws.stribeck import STRIBECK_TILT
from analysis.record import AnalysisError

_COMPARED = (COULOMB, COULOMB_TILT, STATIC, STATIC_TILT)
"""Laws that are always compared, by rising number of parameters; their motion is in closed form."""
_FALLBACK = (STRIBECK_TILT,)  # laws that are tried where none of the compared ones explains the record


def _with_places(laws: tuple[FrictionLaw, ...]) -> tuple[FrictionLaw, ...]:
    """The laws, with places for their own parameters one after another."""
    placed, place = [], SHARED_PARAMETER_COUNT
    for law in laws:
        placed.append(replace(law, own_start=place))
        place += len(law.own)
    return tuple(placed)


LAWS = _with_places(_COMPARED + _FALLBACK)
COMPARED_LAWS, FALLBACK_LAWS = LAWS[: len(_COMPARED)], LAWS[len(_COMPARED) :]
WIDEST_LAW = max(COMPARED_LAWS, key=lambda law: len(law.free_parameters))
"""The compared law that has all others as special cases."""


def compared_law(*, static_friction: bool, tilt: bool) -> FrictionLaw:
    """The compared law with exactly these parameters beside f_d."""
    return next(
        law for law in COMPARED_LAWS if (law.has_static_friction, law.has_tilt) == (static_friction, tilt)
    )


FIRST_SLIP_LAW = compared_law(static_friction=False, tilt=WIDEST_LAW.has_tilt)
"""Until the first slip ends no stick has ended, so that f_s plays no part."""
OWN_PARAMETERS = tuple(parameter for law in LAWS for parameter in law.own)
PARAMETER_COUNT = SHARED_PARAMETER_COUNT + len(OWN_PARAMETERS)


def law_by_name(name: str) -> FrictionLaw:
    """The law of this name; raises AnalysisError if there is none."""
    for law in LAWS:
        if law.name == name:
            return law
    raise AnalysisError(
        "model {name} is unknown. Choose one of {names}.", name=repr(name), names=[law.name for law in LAWS]
    )


def law_without(law: FrictionLaw, parameter: Parameter) -> FrictionLaw | None:
    """The compared law that lacks only this one of the parameters of `law`; None if there is none."""
    wanted = set(law.free_parameters) - {parameter}
    if wanted == set(law.free_parameters):
        return None
    return next((other for other in COMPARED_LAWS if set(other.free_parameters) == wanted), None)


def default_point() -> Floats:
    """A parameter vector of zeros, but for the laws' own parameters at their defaults."""
    return np.array([0.0] * SHARED_PARAMETER_COUNT + [parameter.default for parameter in OWN_PARAMETERS])
