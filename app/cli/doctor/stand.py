"""Effects that the stand shows over its last runs."""

from collections.abc import Iterator

from analysis.campaign.stand_effects import EffectScope, summarize_effects
from app.cli.doctor import Finding, ok, warn
from app.runs.campaign.last_runs import RUNS_MOST, read_last_runs
from app.runs.paths import recordings_directory
from config.files import load_stand
from config.schema import ConfigError

_SUBJECT = "effects of the stand"


def check_effects() -> Iterator[Finding]:
    """Look at results kept in the last runs; none is analysed. Wrong settings are told elsewhere."""
    try:
        last = read_last_runs(recordings_directory(), load_stand().name)
    except ConfigError:
        return
    count = len(last.results)
    which = f"kept results of the last {last.looked_at} run files (at most {RUNS_MOST} are read)"
    if not count:
        yield ok(_SUBJECT, f"{which}: none of this stand; analyze --save keeps them")
        return
    effects = summarize_effects(last.results)
    searched = sum(result.effects is not None for result in last.results)
    said = f"{count} {which}, {searched} of them searched for effects"
    yield ok(_SUBJECT, said if effects else f"{said}: none")
    for effect in effects:
        if effect.scope is EffectScope.RUNS and 2 * len(effect.runs) <= effect.run_count:
            yield ok(effect.name, str(effect.message))
        else:
            remedy = f"What it costs: slipstand plan. All runs: slipstand table {last.folder}"
            yield warn(effect.name, str(effect.message), remedy)
