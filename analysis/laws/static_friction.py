"""Coulomb friction with a larger coefficient at standstill: f_s >= f_d."""

from analysis.laws.law import FrictionLaw
from analysis.laws.parameters import Parameter
from analysis.laws.solvers import CLOSED_FORM

STATIC = FrictionLaw("static", "f_s >= f_d on a level plane", CLOSED_FORM, (Parameter.FRICTION_STATIC,))
STATIC_TILT = FrictionLaw(
    "static+tilt",
    "f_s >= f_d on a tilted plane",
    CLOSED_FORM,
    (Parameter.FRICTION_STATIC, Parameter.TILT),
)
