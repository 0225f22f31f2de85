"""Summary of a run for the library, read without its samples."""

import datetime

import h5py
import msgspec

from analysis.identification import Degree
from app.runs import schema
from app.runs.columns import stored_rows
from app.runs.fields import read_text
from app.runs.metadata import Conditions, RunSource
from app.runs.metadata_io import read_identifier, read_metadata
from app.runs.saved_analyses import metadata_hash, read_all_analyses
from messages.message import Message


class RunSummary(msgspec.Struct, frozen=True, gc=False):
    """One line of the library; where `fault` is set, the rest could not be read.

    Without `gc=False` the garbage collector slows a listing of ten thousand by half.
    """

    path: str
    fault: Message = Message("")
    title: str = ""
    series: str | None = None
    start_time: datetime.datetime | None = None
    samples: int = 0
    duration_s: float = 0.0
    ended: str = ""
    operator: str = ""
    note: str = ""
    plate_mass_kg: float | None = None
    pullback_m: float | None = None
    source: RunSource | None = None  # None where it could not be read
    origin: str = ""
    """Where a run that was not recorded here comes from, for example `imported from run.csv`."""
    analyses: int = 0
    damaged_analyses: int = 0  # further ones, which are not what was kept and are not taken
    friction_dynamic: float | None = None
    """Of the newest saved analysis, stale or not."""
    friction_dynamic_uncertainty: float | None = None
    period_s: float | None = None
    """Of the same analysis, as the next three."""
    period_uncertainty_s: float | None = None
    damping_n1_per_s: float | None = None
    damping_n1_uncertainty_per_s: float | None = None
    stale: bool = False
    """Masses, calibration or pullback have been changed since the newest saved analysis."""
    adequate: bool | None = None  # whether its model fits; None where it has none
    friction_holds: bool = False  # it does not, but independent estimates of f_d agree
    identifier: str = ""  # UUID given when it was recorded: the same under every name
    edits: int = 0
    conditions: Conditions = Conditions()
    excluded: str = ""
    """Why it does not count in a campaign; empty where it does."""


_OF_METADATA = (
    "title", "series", "start_time", "operator", "note", "plate_mass_kg", "pullback_m",
    "conditions", "excluded",
)  # fmt: skip


def summarize_file(file: h5py.File) -> RunSummary:
    """Summary of an open run. Raises DamagedRunError."""
    metadata = read_metadata(file)
    rows = stored_rows(file)
    analyses, damaged = read_all_analyses(file)
    results = analyses[-1].document["results"] if analyses else {}
    friction, period, damping = (
        results.get(name, {}) for name in ("friction_dynamic", "period_s", "damping_n1_per_s")
    )
    model = (analyses[-1].document["model"] or {}) if analyses else {}
    return RunSummary(
        path=file.filename,
        **{name: getattr(metadata, name) for name in _OF_METADATA},
        source=metadata.source_type,
        origin=metadata.origin,
        samples=rows,
        duration_s=float(file[schema.TIME][rows - 1]) if rows else 0.0,
        ended=read_text(file, schema.ENDED),
        analyses=len(analyses),
        damaged_analyses=len(damaged),
        friction_dynamic=friction.get("value"),
        friction_dynamic_uncertainty=friction.get("standard_uncertainty"),
        period_s=period.get("value"),
        period_uncertainty_s=period.get("standard_uncertainty"),
        damping_n1_per_s=damping.get("value"),
        damping_n1_uncertainty_per_s=damping.get("standard_uncertainty"),
        stale=bool(analyses) and analyses[-1].metadata_hash != metadata_hash(file, metadata),
        adequate=model.get("adequate"),
        friction_holds=model.get("degree") == Degree.FRICTION.value,
        identifier=read_identifier(file),
        edits=len(file[schema.HISTORY]),
    )
