"""Slipstand as a Python package: read runs, identify them, pool them, simulate and plan tests.

What `__all__` names is public and stable: a name is removed only after a version in which its use warns
(docs/reference/python.md). The parts below (`slipstand.app` and others of an installation) are internal.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from analysis.calibration.calibrate import Calibration, DialGauge
    from analysis.quantities import BudgetLine, Quantity, ResultWarning
    from analysis.record import AnalysisError, GaugeFilter, GaugeUncertainty, Record, RecordError, StandMasses
    from app.runs.errors import RunError
    from app.version import __version__
    from messages.message import MessageError
    from slipstand.campaign import PooledSeries, pool
    from slipstand.results import Result, identify, one_mass
    from slipstand.runs import Run, read_run
    from slipstand.stand import SimulatedTest, TestPlan, calibrate, plan, simulate

_PLACES = {
    "analysis.calibration.calibrate": ("Calibration", "DialGauge"),
    "analysis.quantities": ("BudgetLine", "Quantity", "ResultWarning"),
    "analysis.record": (
        "AnalysisError", "GaugeFilter", "GaugeUncertainty", "Record", "RecordError", "StandMasses",
    ),
    "app.runs.errors": ("RunError",),
    "app.version": ("__version__",),
    "messages.message": ("MessageError",),
    "slipstand.campaign": ("PooledSeries", "pool"),
    "slipstand.results": ("Result", "identify", "one_mass"),
    "slipstand.runs": ("Run", "read_run"),
    "slipstand.stand": ("SimulatedTest", "TestPlan", "calibrate", "plan", "simulate"),
}  # fmt: skip
"""Modules by which the public names are defined; each is imported when a name of it is first used."""

__all__ = [
    "AnalysisError",
    "BudgetLine",
    "Calibration",
    "DialGauge",
    "GaugeFilter",
    "GaugeUncertainty",
    "MessageError",
    "PooledSeries",
    "Quantity",
    "Record",
    "RecordError",
    "Result",
    "ResultWarning",
    "Run",
    "RunError",
    "SimulatedTest",
    "StandMasses",
    "TestPlan",
    "__version__",
    "calibrate",
    "identify",
    "one_mass",
    "plan",
    "pool",
    "read_run",
    "simulate",
]


def __getattr__(name: str) -> Any:
    for module, names in _PLACES.items():
        if name in names:
            value = globals()[name] = getattr(import_module(module), name)
            return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
