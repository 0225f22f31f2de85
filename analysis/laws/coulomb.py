"""Coulomb friction: f_d while the plate slides; at standstill f_s, which is f_d or larger."""

from analysis.laws.law import CLOSED_FORM, FrictionLaw
from analysis.laws.parameters import Parameter

COULOMB = FrictionLaw("coulomb", "f_s = f_d on a level plane", CLOSED_FORM)
COULOMB_TILT = FrictionLaw("coulomb+tilt", "f_s = f_d on a tilted plane", CLOSED_FORM, (Parameter.TILT,))
STATIC = FrictionLaw("static", "f_s >= f_d on a level plane", CLOSED_FORM, (Parameter.FRICTION_STATIC,))
STATIC_TILT = FrictionLaw(
    "static+tilt", "f_s >= f_d on a tilted plane", CLOSED_FORM, (Parameter.FRICTION_STATIC, Parameter.TILT)
)
