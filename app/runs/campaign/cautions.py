"""What must be known of runs that are taken together, and what to do about it."""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from analysis.campaign.series import RunResult
from analysis.quantities import ResultWarning
from app.runs.campaign.one_run import RunDetails
from app.runs.journals import unfinished_journals
from app.runs.trash import list_trash
from config.schema import ConfigError, Stand

_NAMED = 3
"""So many runs are named, the others counted."""


def campaign_warnings(
    runs: Sequence[RunResult],
    facts: Mapping[str, RunDetails],
    stands: Mapping[str, Stand],
    folders: Sequence[Path],
    *,
    saved: bool,
) -> tuple[ResultWarning, ...]:
    """Everything that is to be said of runs together.

    Parameters
    ----------
    runs, facts, stands
        As in `app.runs.campaign.gathering.Gathered`.
    folders
        Folders that were looked through.
    saved
        Whether new results were kept.
    """
    return (
        *_different_stands(runs, facts, stands),
        *_contradictory_masses(runs, facts, stands),
        *_stale(runs, facts, saved=saved),
        *_series_without_runs(runs, facts, stands),
        *_left_out(folders),
    )


def _different_stands(
    runs: Sequence[RunResult], facts: Mapping[str, RunDetails], stands: Mapping[str, Stand]
) -> Iterator[ResultWarning]:
    by_name: dict[str, list[str]] = defaultdict(list)
    for run in runs:
        by_name[stands[facts[run.name].stand].name].append(run.name)
    if len(by_name) > 1:
        said = "; ".join(f"{name!r}: {_listed(of_it)}" for name, of_it in by_name.items())
        yield ResultWarning(
            "different-stands",
            f"these runs are of {len(by_name)} stands ({said}). Give the runs of one stand at a time,"
            " each in a folder of its own.",
        )


def _contradictory_masses(
    runs: Sequence[RunResult], facts: Mapping[str, RunDetails], stands: Mapping[str, Stand]
) -> Iterator[ResultWarning]:
    """Series whose runs say different masses, and runs whose plate has not the mass of their series."""
    by_series: dict[str, dict[tuple[float, float], list[str]]] = defaultdict(lambda: defaultdict(list))
    for run in runs:
        if run.series.code:
            key = run.series
            by_series[key.code][key.table_mass_kg, key.plate_mass_kg].append(run.name)
    remedy = "Correct the wrong ones: slipstand edit RUN --plate-mass KG --table-mass KG."
    for code, masses in by_series.items():
        stand = stands[facts[next(iter(masses.values()))[0]].stand]
        if len(masses) > 1:
            said = "; ".join(
                f"m1 = {table_kg:g} kg and m2 = {plate_kg:g} kg: {_listed(of_them)}"
                for (table_kg, plate_kg), of_them in masses.items()
            )
            yield ResultWarning(
                "contradictory-masses", f"the runs of {code} say different masses ({said}). {remedy}"
            )
        elif (nominal_kg := _nominal_mass_kg(stand, code)) not in (None, *(m2 for _, m2 in masses)):
            ((_, plate_kg), of_them) = next(iter(masses.items()))
            yield ResultWarning(
                "mass-not-of-series",
                f"the plate of {code} has {plate_kg:g} kg in {_listed(of_them)}, but {nominal_kg:g} kg by its"
                f" series. {remedy}",
            )


def _nominal_mass_kg(stand: Stand, code: str) -> float | None:
    try:
        return stand.series(code).plate_mass_kg
    except ConfigError:
        return None


def _stale(
    runs: Sequence[RunResult], facts: Mapping[str, RunDetails], *, saved: bool
) -> Iterator[ResultWarning]:
    stale = [run.name for run in runs if facts[run.name].stale]
    if stale:
        kept = "the new results are kept" if saved else "keep the new results with --save"
        yield ResultWarning(
            "results-stale",
            f"masses, pullback or calibration were changed after the analysis of {_listed(stale)}: what is"
            f" taken agrees with them now, {kept}.",
        )


def _series_without_runs(
    runs: Sequence[RunResult], facts: Mapping[str, RunDetails], stands: Mapping[str, Stand]
) -> Iterator[ResultWarning]:
    """Series between those that have runs; a single series is no campaign that could lack any."""
    codes = Counter(run.series.code for run in runs if run.series.code and not run.excluded)
    names = {facts[run.name].stand for run in runs}
    if len(codes) < 2 or len(names) != 1:
        return
    stand = stands[names.pop()]
    wanted = [
        f"{pullback}{contact}{mass}"
        for contact in stand.contacts
        for pullback in stand.pullbacks_m
        for mass in stand.added_masses_kg
    ]
    missing = [code for code in wanted if code not in codes]
    if missing:
        yield ResultWarning(
            "series-without-runs",
            f"{len(missing)} of the stand's {len(wanted)} series have no run: {_listed(missing, 12)}."
            " Record them, or look for their runs in another folder.",
        )


def _left_out(folders: Sequence[Path]) -> Iterator[ResultWarning]:
    for folder in folders:
        if thrown := list_trash(folder):
            yield ResultWarning(
                "runs-in-trash",
                f"{len(thrown)} runs in the trash of {folder} are left out. Bring one back:"
                " slipstand trash --restore RUN.",
            )
        if cut_short := unfinished_journals(folder):
            yield ResultWarning(
                "runs-cut-short",
                f"{len(cut_short)} recordings in {folder} were cut short and may hold more than is seen here."
                f" Rebuild them: slipstand recover {folder}.",
            )


def _listed(names: Sequence[str], most: int = _NAMED) -> str:
    """`a.h5, b.h5, c.h5 and 4 more`."""
    shown = ", ".join(Path(name).name for name in names[:most])
    return shown + (f" and {len(names) - most} more" if len(names) > most else "")
