"""How a summary of a run is read from its file, without its samples."""

import h5py

from analysis.identification import Degree
from app.runs import schema
from app.runs.analysis_request import AnalysisRequest
from app.runs.columns import stored_rows
from app.runs.fields import read_text
from app.runs.metadata_io import read_identifier, read_metadata
from app.runs.saved_analyses import is_stale, read_all_analyses
from app.runs.summary import RunSummary

_OF_METADATA = (
    "title", "series", "start_time", "operator", "note", "plate_mass_kg", "pullback_m",
    "conditions", "excluded",
)  # fmt: skip


def summarize_file(file: h5py.File) -> RunSummary:
    """Summary of an open run. Raises DamagedRunError."""
    metadata = read_metadata(file)
    rows = stored_rows(file)
    analyses, damaged = read_all_analyses(file)
    valid = [saved for saved in analyses if not is_stale(file, metadata, saved)]
    requests = (AnalysisRequest.of_settings(saved.settings) for saved in valid)
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
        stale=bool(analyses) and (not valid or valid[-1] is not analyses[-1]),
        valid_requests=tuple(dict.fromkeys(request.key for request in requests if request is not None)),
        adequate=model.get("adequate"),
        friction_holds=model.get("degree") == Degree.FRICTION.value,
        identifier=read_identifier(file),
        edits=len(file[schema.HISTORY]),
    )
