"""Displacements that are likely in another unit than they were taken for."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analysis.formatting import format_number
from app.runs.errors import ImportFileError
from app.runs.exchange.importing import LENGTH_UNITS_M, Floats, ForeignRecord, ImportPlan, LengthUnit
from config.schema import Gauges
from messages.i18n import N_
from messages.message import Message, message, option

_TYPICAL_M = 0.01
_SMALLEST_M = 1e-4
"""A pullback test moves the table by millimetres."""
_ROWS_OF_NOISE, _STEPS_OF_NOISE = 100_000, 20.0
"""Noise of a million rows spans some eleven times the median of its steps."""
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
    facts = record.facts
    stated_m = (gauges.table.range_m, gauges.relative.range_m)
    for number, (gauge, cells, range_m) in enumerate(zip(facts.gauges, record.cells, stated_m, strict=False)):
        span = float(np.fmax.reduce(cells) - np.fmin.reduce(cells))
        span_m = span * abs(gauge.gain_m_per_count)
        largest_m = 2.0 * range_m if range_m else _LARGEST_M
        if span_m > largest_m:
            template = N_("gauge {number} moves by {span}, more than its range of {range}")
            fault = message(template, number=number + 1, span=_length(span_m), range=_length(largest_m))
        elif number == 0 and _is_too_small(span_m, largest_m) and _moves(cells, span):
            fault = message("gauge 1 moves by {span} only", span=_length(span_m))
        else:
            continue
        return UnlikelySize(fault, _likely_unit(span, largest_m) if plan.gain is None else None)
    return None


def check_size(path: Path, record: ForeignRecord, plan: ImportPlan, gauges: Gauges) -> None:
    """Refuse an unlikely size, unless the plan takes any. Raises ImportFileError."""
    found = None if plan.any_size else unlikely_size(record, plan, gauges)
    if found is None:
        return
    if found.unit is None:
        raise ImportFileError(
            "{path}: {fault}. Check {unit_option} and {gain_option}; if it is right, set {option}",
            path=path,
            fault=found.fault,
            unit_option=option("--unit"),
            gain_option=option("--gain"),
            option=option("--any-size"),
        )
    raise ImportFileError(
        "{path}: {fault}. If it is in {unit}, set {unit_option} {unit}; if it is right, set {option}",
        path=path,
        fault=found.fault,
        unit=found.unit,
        unit_option=option("--unit"),
        option=option("--any-size"),
    )


def _is_too_small(span_m: float, largest_m: float) -> bool:
    """Tell whether a distance is none of a test, but a thousand or a million times it is."""
    return span_m < _SMALLEST_M and any(_SMALLEST_M <= span_m * scale <= largest_m for scale in (1e3, 1e6))


def _likely_unit(span: float, largest_m: float) -> LengthUnit | None:
    """Unit in which a distance is one of a test."""
    spans_m = {unit: span * scale_m for unit, scale_m in LENGTH_UNITS_M.items()}
    likely = [unit for unit, span_m in spans_m.items() if _SMALLEST_M <= span_m <= largest_m]
    return min(likely, key=lambda unit: abs(math.log(spans_m[unit] / _TYPICAL_M)), default=None)


def _moves(cells: Floats, span: float) -> bool:
    """Tell whether a gauge does more than noise, which is seen from one row to the next."""
    steps = np.abs(np.diff(cells[:_ROWS_OF_NOISE]))
    steps = steps[~np.isnan(steps)]
    return bool(len(steps)) and span > _STEPS_OF_NOISE * float(np.median(steps))


def _length(length_m: float) -> str:
    unit, scale = ("m", 1.0) if length_m >= 1.0 else ("mm", 1e3) if length_m >= _SMALLEST_M else ("µm", 1e6)
    return f"{format_number(scale * length_m, 4)} {unit}"
