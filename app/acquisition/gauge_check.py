"""Checks of a gauge before a test: a known displacement, and the entry that is kept."""

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
    """The known step that a gauge is checked with."""

    value: float  # how far it is moved (m), or by how many counts the shunt resistor shifts it
    standard_uncertainty: float | None = None  # in the same unit
    unit: Literal["m", "count"] = "m"
    kind: Literal["displacement", "shunt"] = "displacement"
    """`displacement`, or `shunt`, which shifts the amplifier's input while nothing moves."""


def check_gauge(
    rest: AveragedCounts, moved: AveragedCounts, gauge: Gauge, known: ReferenceStep
) -> DisplacementCheck:
    """Compare the step between two averages with the known one. Raises CalibrationError."""
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
    """Entry of a check made now, as it is stored."""
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
    return _displacement_m(counts + step, gauge) - _displacement_m(counts, gauge)
