"""A gauge tried before a test: readings of a stream against what is known, and the entry that is kept."""

import datetime
from dataclasses import dataclass
from typing import Literal

import numpy as np

from analysis.calibration.known_displacement import (
    CalibrationClaim,
    DisplacementCheck,
    MeanReading,
    ReferenceDisplacement,
    check_displacement,
)
from app.acquisition.averaged_counts import AveragedCounts
from config.schema import Gauge, GaugeCheck


@dataclass(frozen=True, slots=True)
class ReferenceStep:
    """What the gauge is tried with.

    Attributes
    ----------
    value : float
        How far it is moved (m), or by how many counts the shunt resistor shifts it.
    standard_uncertainty : float, optional
        In the same unit.
    unit : str
        `m`, or `count` for a shunt that is known by its counts.
    kind : str
        `displacement`, or `shunt`, which shifts the amplifier's input while nothing moves.
    """

    value: float
    standard_uncertainty: float | None = None
    unit: Literal["m", "count"] = "m"
    kind: Literal["displacement", "shunt"] = "displacement"


def check_gauge(
    rest: AveragedCounts, moved: AveragedCounts, gauge: Gauge, known: ReferenceStep
) -> DisplacementCheck:
    """Hold the readings at rest and with what is known against each other. Raises CalibrationError."""
    claim = CalibrationClaim(
        gauge.gain_relative_standard_uncertainty, gauge.nonlinearity_m, gauge.repeatability_m
    )
    return check_displacement(
        _reading(rest, gauge), _reading(moved, gauge), _reference(rest, gauge, known), claim
    )


def check_entry(
    name: Literal["table", "relative"],
    gauge: Gauge,
    found: DisplacementCheck,
    known: ReferenceStep,
    *,
    reference: str = "",
    checked_by: str = "",
    device: str = "",
) -> GaugeCheck:
    """The check as it is kept, of now."""
    return GaugeCheck(
        gauge=name,
        at=datetime.datetime.now().astimezone().replace(microsecond=0),
        passed=found.passed,
        expected_m=found.expected_m,
        measured_m=found.measured_m,
        tolerance_m=found.tolerance_m,
        gain_m_per_count=gauge.gain_m_per_count,
        polynomial=gauge.polynomial,
        serial_number=gauge.serial_number,
        kind=known.kind,
        reference=reference,
        checked_by=checked_by,
        device=device,
    )


def _reading(average: AveragedCounts, gauge: Gauge) -> MeanReading:
    return MeanReading(
        _displacement_m(average.counts, gauge),
        abs(_step_m(average.counts, average.noise_counts, gauge)),
        average.samples,
        _step_m(average.counts, average.creep_counts, gauge),
    )


def _reference(rest: AveragedCounts, gauge: Gauge, known: ReferenceStep) -> ReferenceDisplacement:
    is_electric = known.kind == "shunt"
    if known.unit == "m":
        return ReferenceDisplacement(known.value, known.standard_uncertainty, is_electric)
    uncertainty_m = None
    if known.standard_uncertainty is not None:
        uncertainty_m = known.standard_uncertainty * abs(gauge.gain_m_per_count)
    return ReferenceDisplacement(_step_m(rest.counts, known.value, gauge), uncertainty_m, is_electric)


def _displacement_m(counts: float, gauge: Gauge) -> float:
    return float(gauge.displacement_m(np.array([counts]))[0])


def _step_m(counts: float, step: float, gauge: Gauge) -> float:
    """How far a step of counts goes, from where the gauge stands."""
    return _displacement_m(counts + step, gauge) - _displacement_m(counts, gauge)
