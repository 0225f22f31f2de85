"""From readings and what is known of their run to what an analysis takes."""

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analysis.record import GaugeFilter, GaugeUncertainty, Record, StandMasses
from app.runs.errors import UnsuitableRunError
from app.runs.metadata import RunMetadata
from config.schema import Filter, Gauge
from drivers.clock import TimeBase
from drivers.samples import ABSENT_BY_GAUGE, SampleStatus
from messages.i18n import N_

if TYPE_CHECKING:
    from app.runs.reader import Run  # the live identification needs no files

Floats = NDArray[np.float64]

CLOCK_TOLERANCE = 1e-3  # relative standard uncertainty of a device's rate before anybody has timed it


def to_record(run: "Run", *, metres_only: bool = True) -> Record:
    """Readings, masses and calibration as a record; absent samples are NaN. Raises UnsuitableRunError.

    `metres_only` refuses other readings than displacements in metres, in which friction needs them.
    """
    if not len(run):
        raise UnsuitableRunError("{path} holds no samples. Record the run again", path=run.path)
    quantity, unit = run.metadata.quantity, run.metadata.unit
    if metres_only and (quantity, unit) != ("displacement", "m"):
        template = N_(
            "{path} holds a {quantity} in {unit}, but friction needs displacements in m."
            " Analyse it with --kind one-mass"
        )
        raise UnsuitableRunError(template, path=run.path, quantity=quantity, unit=unit)
    no_table, no_relative = ((run.status & absent) != 0 for absent in ABSENT_BY_GAUGE)
    relative = run.relative_reading
    record = build_record(
        run.metadata,
        run.time_s,
        np.where(no_table, np.nan, run.table_reading),
        None if relative is None else np.where(no_relative, np.nan, relative),
        TimeBase() if run.end is None else run.end.time_base,
    )
    return record.replace(
        table_overload=(run.status & SampleStatus.OVERLOAD_TABLE) != 0,
        relative_overload=(run.status & SampleStatus.OVERLOAD_RELATIVE) != 0,
    )


def build_record(
    metadata: RunMetadata,
    time_s: Floats,
    table_displacement_m: Floats,
    relative_displacement_m: Floats | None,
    time_base: TimeBase,
) -> Record:
    """Readings (n,) with what the metadata of their run know of stand and gauges."""
    clock_scale, clock_scale_uncertainty = combine_clock_scale(time_base)
    relative = gauge_uncertainty(metadata.gauges.relative)
    skew_u_s = time_base.skew_standard_uncertainty_s or 0.0
    relative = dataclasses.replace(
        relative,
        delay_s=relative.delay_s - (time_base.skew_s or 0.0),  # read later than its row says
        delay_s_uncertainty=math.hypot(relative.delay_s_uncertainty, skew_u_s),
    )
    return Record(
        time_s=time_s,
        table_displacement_m=table_displacement_m,
        relative_displacement_m=relative_displacement_m,
        masses=_masses(metadata),
        pullback_m=metadata.pullback_m,
        clock_scale=clock_scale,
        clock_scale_uncertainty=clock_scale_uncertainty,
        clock_is_timed=clock_scale_uncertainty > 0.0 or bool(metadata.truth),
        table_gauge=gauge_uncertainty(metadata.gauges.table),
        relative_gauge=relative,
        gauge_2_measures_plate=metadata.gauges.relative.measures == "plate",
    )


def combine_clock_scale(time_base: TimeBase) -> tuple[float, float]:
    """Scale of the device's clock and its uncertainty, as timed and as made (docs/decisions/0006)."""
    scale, timed = time_base.scale, time_base.scale_standard_uncertainty
    if timed == 0.0:
        return scale, 0.0
    share = CLOCK_TOLERANCE**2 / (CLOCK_TOLERANCE**2 + timed**2)
    return 1.0 + share * (scale - 1.0), timed * share**0.5


def gauge_uncertainty(gauge: Gauge) -> GaugeUncertainty:
    """What the calibration of a gauge says of its readings."""
    return GaugeUncertainty(
        gain_relative=gauge.gain_relative_standard_uncertainty,
        nonlinearity_m=gauge.nonlinearity_m or 0.0,
        delay_s=gauge.delay_s,
        delay_s_uncertainty=gauge.delay_standard_uncertainty_s,
        range_m=gauge.range_m,
        filter=_filter(gauge.filter),
    )


def _filter(stated: Filter | None) -> GaugeFilter | None:
    if stated is None or stated.kind == "none" or stated.corner_hz is None:
        return None
    share = stated.corner_relative_standard_uncertainty
    return GaugeFilter(stated.kind, stated.order, stated.corner_hz, share)


def _masses(metadata: RunMetadata) -> StandMasses:
    stand = metadata.stand
    return StandMasses(
        table_mass_kg=metadata.table_mass_kg,
        plate_mass_kg=metadata.plate_mass_kg,
        table_mass_uncertainty_kg=stand.table_mass_standard_uncertainty_kg,
        plate_mass_uncertainty_kg=stand.plate_mass_standard_uncertainty_kg,
        gravity_m_per_s2=stand.gravity_m_per_s2,
        gravity_uncertainty_m_per_s2=stand.gravity_standard_uncertainty_m_per_s2,
    )
