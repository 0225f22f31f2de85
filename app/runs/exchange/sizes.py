"""Displacements that are likely in another unit than they were taken for."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.runs.errors import ImportFileError
from app.runs.exchange.importing import LENGTH_UNITS_M, ForeignRecord, ImportPlan, LengthUnit
from config.schema import Gauges
from messages.i18n import N_
from messages.message import Message, message, option

_TYPICAL_M = 0.01
_SMALLEST_M = 1e-4
"""A pullback test moves the table by millimetres, a thousand times less by micrometres."""
_LARGEST_M = 1.0
"""Of a gauge whose range is not stated."""


@dataclass(frozen=True, slots=True)
class UnlikelySize:
    """Readings of a gauge that are too large for it, or too small for a test."""

    fault: Message
    unit: LengthUnit | None
    """In which they would be likely; None where none is, or a gain states what a cell means."""


def unlikely_size(record: ForeignRecord, plan: ImportPlan, gauges: Gauges) -> UnlikelySize | None:
    """Look for displacements beyond the range of a gauge of the stand, or far below a pullback."""
    if plan.quantity != "displacement" or plan.unit_name not in (None, "m"):
        return None
    stated_m = (gauges.table.range_m, gauges.relative.range_m)
    for number, (span_m, range_m) in enumerate(zip(_spans(record), stated_m, strict=False)):
        largest_m = 2.0 * range_m if range_m else _LARGEST_M
        # A plate that never slips moves the second gauge by nothing.
        smallest_m = 0.0 if number else _SMALLEST_M
        if smallest_m <= span_m <= largest_m:
            continue
        fault = N_("gauge {number} moves over {span}, more than its range of {range}")
        if span_m < smallest_m:
            fault = N_("gauge {number} moves over {span} only")
        cells_m = span_m / record.facts.gauges[number].gain_m_per_count
        unit = (
            None
            if plan.gain is not None
            else _likely_unit(abs(cells_m), max(smallest_m, _SMALLEST_M), largest_m)
        )
        return UnlikelySize(
            message(fault, number=number + 1, span=_length(span_m), range=_length(largest_m)), unit
        )
    return None


def check_size(path: Path, record: ForeignRecord, plan: ImportPlan, gauges: Gauges) -> None:
    """Refuse an unlikely size, unless the plan takes any. Raises ImportFileError."""
    found = None if plan.any_size else unlikely_size(record, plan, gauges)
    if found is None:
        return
    if found.unit is None:
        raise ImportFileError(
            "{path}: {fault}. Check {unit_option} or {gain_option}; if it is right, add {option}",
            path=path,
            fault=found.fault,
            unit_option=option("--unit"),
            gain_option=option("--gain"),
            option=option("--any-size"),
        )
    raise ImportFileError(
        "{path}: {fault}. If its cells are in {unit}, add {unit_option} {unit}; if it is right, add {option}",
        path=path,
        fault=found.fault,
        unit=found.unit,
        unit_option=option("--unit"),
        option=option("--any-size"),
    )


def _spans(record: ForeignRecord) -> Iterator[float]:
    """Distance between the lowest and the highest reading of each gauge (m)."""
    for gauge, cells in zip(record.facts.gauges, record.cells, strict=True):
        yield abs(gauge.gain_m_per_count) * float(np.fmax.reduce(cells) - np.fmin.reduce(cells))


def _likely_unit(span: float, smallest_m: float, largest_m: float) -> LengthUnit | None:
    """Unit in which a distance is one of a test."""
    spans_m = {unit: span * scale_m for unit, scale_m in LENGTH_UNITS_M.items()}
    likely = [unit for unit, span_m in spans_m.items() if smallest_m <= span_m <= largest_m]
    return min(likely, key=lambda unit: abs(math.log(spans_m[unit] / _TYPICAL_M)), default=None)


def _length(length_m: float) -> str:
    unit, scale = ("m", 1.0) if length_m >= 1.0 else ("mm", 1e3) if length_m >= _SMALLEST_M else ("um", 1e6)
    return f"{scale * length_m:.4g} {unit}"
