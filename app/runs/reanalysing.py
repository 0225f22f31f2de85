"""The identification that stands in a run made again, for what a file does not keep: curves and motion."""

from pathlib import Path

import msgspec

from app.runs.analyses import latest_valid
from app.runs.analysing import Analysis, AnalysisRequest, analyze_run
from app.runs.examiner import Validator
from app.runs.reader import open_run
from app.runs.records import to_record


def repeat_saved_analysis(path: Path, validator: Validator | None = None) -> Analysis:
    """Identify a run in the way of its newest analysis that still stands, else in the usual way.

    Raises
    ------
    RunError
        The run cannot be read.
    AnalysisError
        It cannot be identified.
    """
    run = open_run(path, validator=validator)
    in_metres = run.metadata.unit == "m" and run.metadata.quantity == "displacement"
    kept = latest_valid(run.analyses, to_record(run, metres_only=in_metres))
    request = AnalysisRequest() if kept is None else msgspec.convert(kept.settings, AnalysisRequest)
    request = msgspec.structs.replace(request, classical=False, monte_carlo=None)
    return analyze_run(path, request, trusted=True)
