"""`slipstand simulate`: one simulated test as numbers, CSV or a run.

What simulates is imported once it is known whether compiled code is worth its loading.
"""

from typing import Final

from analysis.compiled import interpret
from app.cli.measurement_options import SimulateOptions

_BRIEF_S: Final = 10.0
_BRIEF_READINGS: Final = 10_000


def simulate(options: SimulateOptions) -> None:
    if _is_brief(options):
        interpret()
    from app.cli.simulation import simulate_test

    simulate_test(options)


def _is_brief(options: SimulateOptions) -> bool:
    """Tell whether the motion is computed sooner than compiled code is loaded: exact, short, and no run."""
    writes_run = options.output is not None and options.output.suffix.lower() == ".h5"
    is_short = options.duration <= _BRIEF_S and options.duration * options.rate <= _BRIEF_READINGS
    return is_short and options.method == "exact" and not options.effects and not writes_run
