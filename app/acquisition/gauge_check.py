"""Checks of a gauge before a test: samples at rest, a known displacement, and the entry that is kept."""

import datetime
import time
from collections.abc import Sequence
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
from analysis.gauge_health import GaugeSamples
from app.acquisition.averaged_counts import OVERLOAD_FLAGS, TIMEOUT_S, AveragedCounts, SampleStream
from app.acquisition.errors import AcquisitionError
from app.runs.blocks import CalibratedBlock
from config.schema import Gauge, GaugeCheck, Gauges


@dataclass(frozen=True, slots=True)
class ReferenceStep:
    """The known step that a gauge is checked with."""

    value: float
    """How far it is moved (m), or by how many counts the shunt resistor shifts it."""
    standard_uncertainty: float | None = None
    """In the same unit."""
    unit: Literal["m", "count"] = "m"
    """`m`, or `count` for a shunt that is known by its counts."""
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
    """Displacement (m) of a step of counts from the present reading."""
    return _displacement_m(counts + step, gauge) - _displacement_m(counts, gauge)


class NoSamplesError(AcquisitionError):
    """Too few samples came in time."""


def collect_samples(
    stream: SampleStream, seconds: float, gauges: Gauges
) -> tuple[GaugeSamples, GaugeSamples]:
    """Collect samples of both gauges from now on; whatever else the stream brings is dropped.

    Raises NoSamplesError if too few come, or AcquisitionError or DriverError if the stream has ended.
    """
    wanted, taken = round(seconds * stream.rate_hz), list[CalibratedBlock]()
    ends_s = time.monotonic() + seconds + TIMEOUT_S
    while sum(map(len, taken)) < wanted:
        if time.monotonic() > ends_s:
            raise NoSamplesError(
                "only {samples} of {wanted} samples came in {seconds:g} s. Check cable, power and rate"
                " of the device",
                samples=sum(map(len, taken)),
                wanted=wanted,
                seconds=seconds + TIMEOUT_S,
            )
        chunk = stream.next_read(0.1)
        taken += chunk.rows if chunk is not None else ()
    return gauge_samples(taken, stream.rate_hz, gauges)


def gauge_samples(
    rows: Sequence[CalibratedBlock], rate_hz: float, gauges: Gauges
) -> tuple[GaugeSamples, GaugeSamples]:
    """Samples of both gauges, each as it is mounted, from consecutive blocks."""
    readings = np.concatenate([block.readings for block in rows])
    status = np.concatenate([block.status for block in rows])
    table, relative = (
        GaugeSamples(readings[:, channel], (status & flag) != 0, rate_hz, gauge.range_m)
        for channel, (flag, gauge) in enumerate(
            zip(OVERLOAD_FLAGS, (gauges.table, gauges.relative), strict=True)
        )
    )
    return table, relative
