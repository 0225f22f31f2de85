"""Results of the last runs of a stand, as they are kept in its runs."""

import math
import time
from dataclasses import dataclass
from pathlib import Path

from analysis.campaign.series import RunResult
from app.runs.campaign.run_result import CollectedRun, collect_kept
from app.runs.listing import find_run_files
from app.runs.metadata import RunSource

RUNS_MOST = 20  # a few series of a day: enough to tell the stand's effects from those of single runs
_LONGEST_S = 5.0
"""A run takes some 0.1 s; on a slow disk fewer runs are looked at."""


@dataclass(frozen=True, eq=False, slots=True)
class LastRuns:
    """Kept results of the newest runs of a folder, the oldest first."""

    folder: Path
    results: tuple[RunResult, ...]
    looked_at: int  # files that were read


def read_last_runs(folder: Path, stand_name: str) -> LastRuns:
    """Read kept results of this stand among the newest run files of a folder and those below it.

    At most `RUNS_MOST` files are read, and none is analysed. Runs that are excluded do not count, nor
    simulated ones beside recorded ones. A folder that does not exist has none.
    """
    files = sorted(find_run_files(folder), key=_changed_s, reverse=True)[:RUNS_MOST]
    ends_s, found, looked_at = time.perf_counter() + _LONGEST_S, list[CollectedRun](), 0
    for path in files:
        if time.perf_counter() > ends_s:
            break
        looked_at += 1
        found.append(collect_kept(path))
    of_stand = [
        (details.metadata.start_time, result, details.metadata.source_type is RunSource.SIMULATED)
        for one in found
        if (details := one.details) and (result := one.result)
        if details.metadata.stand.name == stand_name and not details.metadata.excluded
    ]
    of_stand.sort(key=lambda one: one[0].timestamp() if one[0] else -math.inf)
    is_simulated = all(simulated for *_, simulated in of_stand)
    results = tuple(result for _, result, simulated in of_stand if simulated == is_simulated)
    return LastRuns(folder, results, looked_at)


def _changed_s(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:  # gone meanwhile
        return 0.0
