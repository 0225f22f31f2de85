"""Rows of the live ring, made from displacements."""

import numpy as np

from app.acquisition.ring import RingRows
from config.files import load_gauges

_GAUGES = load_gauges()


def ring_rows(
    first_index: int, time_s: np.ndarray, table_m: np.ndarray, relative_m: np.ndarray, status: int = 0
) -> RingRows:
    """Rows of the linear gauges in the settings, with the counts that they give."""
    readings = np.column_stack((table_m, relative_m))
    gauges = _GAUGES.table, _GAUGES.relative
    counts = readings / [g.gain_m_per_count for g in gauges] + [g.zero_count for g in gauges]
    flags = np.full(len(time_s), status, np.uint8)
    return RingRows(first_index, counts, readings, relative_m, flags, time_s)
