"""A friction law that is not in the catalogue is fitted as a fallback law."""

from dataclasses import replace

import pytest
from synthetic import Truth, simulate_record

from analysis.arrays import Floats, Indices
from analysis.compiled import compiled_part
from analysis.identify import identify
from analysis.laws.law import FrictionLaw, IntegratedSolver
from analysis.laws.parameters import (
    MOTION_PARAMETER_COUNT,
    SHARED_PARAMETER_COUNT,
    OwnParameter,
    Parameter,
)
from analysis.motion.events import FRICTION_DYNAMIC

SLOPE_S_PER_M = 0.2


@compiled_part
def friction(speed: float, parameters: Floats) -> float:
    coefficient: float = parameters[FRICTION_DYNAMIC] + parameters[MOTION_PARAMETER_COUNT] * speed
    return coefficient


def start_points(point: Floats, own: Indices) -> list[Floats]:
    starts = [point.copy() for _ in range(3)]
    for start, slope in zip(starts, (0.03, 0.15, 0.6), strict=True):
        start[own[0]] = slope
    return starts


FILM = FrictionLaw(
    "viscous+tilt",
    "friction rises with the sliding velocity, on a tilted plane",
    IntegratedSolver(friction, "viscous"),
    (Parameter.FRICTION_STATIC, Parameter.TILT),
    (OwnParameter("friction_slope_s_per_m", "s/m", default=0.0, lower=-2.0, upper=5.0),),
    start_points,
)


def test_a_viscous_film_is_identified(monkeypatch):
    monkeypatch.setattr("analysis.identify.FALLBACK_LAWS", (replace(FILM, own_start=SHARED_PARAMETER_COUNT),))
    truth = Truth(rate_hz=500.0, friction_static=0.11, seed=3)
    motion = FILM.solver.simulate(truth.parameters(), [SLOPE_S_PER_M], truth.duration_s + 0.1)

    found = identify(simulate_record(truth, motion.sample_displacements))

    assert found.model.name == "viscous+tilt"
    assert found.model.adequate
    assert found.results["friction_slope_s_per_m"].value == pytest.approx(SLOPE_S_PER_M, abs=0.005)
    assert found.results["friction_dynamic"].value == pytest.approx(truth.friction_dynamic, rel=0.01)
