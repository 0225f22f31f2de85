"""From a run file to what an analysis takes."""

import numpy as np

from analysis.record import GaugeUncertainty, Record, StandMasses
from app.runs.errors import UnsuitableRunError
from app.runs.metadata import Ending, RunMetadata
from app.runs.reader import Run
from config.schema import Gauge
from drivers.samples import ABSENT, SampleStatus

CLOCK_TOLERANCE = 1e-3
"""Relative standard uncertainty of a device's rate before anybody has timed it."""


def to_record(run: Run, *, metres_only: bool = True) -> Record:
    """Readings, masses and calibration of a run as a record; absent samples are NaN.

    Parameters
    ----------
    run : Run
    metres_only : bool
        Refuse readings that are not displacements in metres. An analysis of free decay alone takes
        any unit; its results are then in `run.metadata.unit`.

    Raises
    ------
    UnsuitableRunError
        The run holds no samples, or readings of another kind.
    """
    if not len(run):
        raise UnsuitableRunError(f"{run.path} holds no samples. Record the run again")
    quantity, unit = run.metadata.quantity, run.metadata.unit
    if metres_only and (quantity, unit) != ("displacement", "m"):
        raise UnsuitableRunError(
            f"{run.path} holds a {quantity} in {unit}, but friction needs displacements in m."
            " Analyse it with --kind one-mass"
        )
    absent = (run.status & ABSENT) != 0
    gauges = run.metadata.gauges
    clock_scale, clock_scale_uncertainty = _clock(run.ending)
    return Record(
        time_s=run.time_s,
        table_displacement_m=np.where(absent, np.nan, run.table_reading),
        relative_displacement_m=(
            None if run.relative_reading is None else np.where(absent, np.nan, run.relative_reading)
        ),
        masses=_masses(run.metadata),
        pullback_m=run.metadata.pullback_m,
        table_overload=(run.status & SampleStatus.OVERLOAD_TABLE) != 0,
        relative_overload=(run.status & SampleStatus.OVERLOAD_RELATIVE) != 0,
        clock_scale=clock_scale,
        clock_scale_uncertainty=clock_scale_uncertainty,
        table_gauge=_uncertainty(gauges.table),
        relative_gauge=_uncertainty(gauges.relative),
        gauge_2_measures_plate=gauges.relative.measures == "plate",
    )


def _clock(ending: Ending | None) -> tuple[float, float]:
    """Scale of the device's clock and its uncertainty: as timed against the host, and as made.

    A short run on a busy host times the clock worse than its maker did (docs/decisions/0006).
    """
    if ending is None:
        return 1.0, 0.0
    timed = ending.clock_scale_uncertainty
    if timed == 0.0:
        return ending.clock_scale, 0.0
    share = CLOCK_TOLERANCE**2 / (CLOCK_TOLERANCE**2 + timed**2)
    return 1.0 + share * (ending.clock_scale - 1.0), timed * share**0.5


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


def _uncertainty(gauge: Gauge) -> GaugeUncertainty:
    return GaugeUncertainty(
        gain_relative=gauge.gain_relative_standard_uncertainty,
        nonlinearity_m=gauge.nonlinearity_m or 0.0,
        delay_s=gauge.delay_s,
        delay_s_uncertainty=gauge.delay_standard_uncertainty_s,
        range_m=gauge.range_m,
    )
