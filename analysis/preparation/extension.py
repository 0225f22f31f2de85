"""A decay that is still being recorded, extended by later readings without preparing it again."""

from dataclasses import replace

import numpy as np

from analysis.arrays import Floats
from analysis.preparation.channels import Channel, remove_drift
from analysis.preparation.free_decay import FreeDecay
from analysis.preparation.oscillation import DampedCosine, refit_damped_cosine
from analysis.record import GaugeUncertainty, Record


def extend_decay(decay: FreeDecay, record: Record) -> FreeDecay | None:
    """`decay` extended by the later readings of the record, with the same signs.

    None where its motion had ended before, or the clock is now known to go otherwise.
    """
    if decay.channels.clock_scale != record.clock_scale:
        return None
    table = _newer(decay.table, record, record.table_displacement_m, record.table_gauge)
    table = remove_drift(table.scaled(decay.sign), decay.table_drift_m_per_s, decay.release.time_s)
    grown = replace(decay, table=_joined(decay.table, table))
    if decay.channels.table.time_s[-1] > decay.table.time_s[-1]:
        return None
    if decay.relative is None or record.relative_displacement_m is None:
        return grown
    relative = _newer(decay.relative, record, record.relative_displacement_m, record.relative_gauge)
    relative = remove_drift(relative.scaled(decay.relative_sign), decay.drift_m_per_s, decay.release.time_s)
    return replace(grown, relative=_joined(decay.relative, relative))


def _newer(channel: Channel, record: Record, value_m: Floats, gauge: GaugeUncertainty) -> Channel:
    """Readings after the last one of `channel`, on its time."""
    time_s = (record.time_s - record.time_s[0]) * record.clock_scale - gauge.lateness_s
    within = np.isfinite(value_m) & (time_s > channel.time_s[-1])
    if gauge.range_m is not None:
        within &= ~(np.abs(value_m) >= gauge.range_m)
    return Channel(time_s[within], value_m[within])


def _joined(before: Channel, after: Channel) -> Channel:
    return Channel(
        np.concatenate((before.time_s, after.time_s)), np.concatenate((before.value_m, after.value_m))
    )


def refine_tail(decay: FreeDecay, before: DampedCosine) -> FreeDecay:
    """The decay with its tail refined from the last one, from the same time on."""
    tail = refit_damped_cosine(decay.table.between(before.start_s, np.inf), before)
    return replace(decay, tail=tail, period_s=tail.period_s)
