"""Foreign records into run files."""

import datetime
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from analysis.preparation.channels import SAMPLES_MIN
from app.runs.blocks import RunBlock, StoredRun
from app.runs.errors import ImportFileError
from app.runs.exchange.columns import ReportShare
from app.runs.exchange.importing import ForeignRecord, ImportPlan
from app.runs.metadata import IMPORT_PROTOCOL, QUANTITY_UNITS, EndMetadata, create_metadata
from app.runs.writer import write_run
from config.schema import Gauges, Stand
from drivers.clock import TimeBase
from drivers.samples import DeviceIdentity, Losses


def store_record(
    path: Path,
    record: ForeignRecord,
    plan: ImportPlan,
    output: Path,
    stand: Stand,
    *,
    replace: bool = False,
    report: ReportShare = lambda _: None,
    **metadata: Any,
) -> tuple[StoredRun, str]:
    """Make a run of a foreign record; return it and the unit of its readings. Raises RunError, ConfigError.

    `metadata` as for `create_metadata`: series, pullback_m, table_mass_kg, operator, note, ...
    """
    check_length(path, record)
    facts, length_s = record.facts, float(record.time_s[-1])
    unit = plan.unit_name or QUANTITY_UNITS[plan.quantity]
    run_metadata = create_metadata(
        stand,
        Gauges(table=facts.gauges[0], relative=facts.gauges[-1].replace(measures=plan.measures)),
        facts.start,
        device=DeviceIdentity(protocol=IMPORT_PROTOCOL, name=path.name),
        rate_hz=facts.rate_hz,
        quantity=plan.quantity,
        unit=unit,
        source=f"imported from {path.name}, time 0 is its {facts.first_s!r} s",
        source_file=facts.source,
        **metadata,
    )
    missing = int(np.count_nonzero(np.isnan(record.cells[0]) & np.isnan(record.cells[-1])))
    ending = EndMetadata(
        ended="imported",
        end_time=facts.start and facts.start + datetime.timedelta(seconds=length_s),
        losses=Losses(samples=len(record), missing=missing),
        time_base=TimeBase(scale_standard_uncertainty=facts.interval_uncertainty),
    )
    stored = write_run(output, run_metadata, _reported(record, report), ending, replace=replace)
    return stored, unit


def check_length(path: Path, record: ForeignRecord) -> None:
    """Refuse what is too short to be a record. Raises ImportFileError."""
    present = int(np.count_nonzero(~np.isnan(record.cells[0])))
    if present < SAMPLES_MIN:
        raise ImportFileError(
            "{path} holds {count} readings of gauge 1, too few for a record: {least} at least. Give the whole"
            " test",
            path=path,
            count=present,
            least=SAMPLES_MIN,
        )


def _reported(record: ForeignRecord, report: ReportShare) -> Iterator[RunBlock]:
    done = 0
    for block in record.blocks():
        yield block
        done += len(block)
        report(done / len(record))
