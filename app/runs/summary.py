"""Summary of a run for the library; a window that shows it loads no HDF5."""

import datetime

import msgspec

from app.runs.metadata import Conditions, RunSource
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
    valid_requests: tuple[str, ...] = ()
    """Requests of the saved analyses that are not stale, see `AnalysisRequest.key`."""
    adequate: bool | None = None  # whether its model fits; None where it has none
    friction_holds: bool = False  # it does not, but independent estimates of f_d agree
    identifier: str = ""  # UUID given when it was recorded: the same under every name
    edits: int = 0
    conditions: Conditions = Conditions()
    excluded: str = ""
    """Why it does not count in a campaign; empty where it does."""
