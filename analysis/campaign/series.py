"""Input of a campaign: results of runs, grouped into series, with warnings about runs that do not fit."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePath

from analysis.quantities import BudgetLine, Quantity, ResultWarning, result_warning
from messages.i18n import N_


@dataclass(frozen=True, slots=True)
class SeriesKey:
    """Properties that all repeats of a series have in common."""

    code: str  # as in the paper, for example "1FFM0"; "" for runs without a series
    contact: str  # code of the pair of surfaces, for example "FF", or any other name; "" where unknown
    pullback_m: float | None  # nominal; None where unknown
    plate_mass_kg: float  # m2 with its added mass
    table_mass_kg: float

    @property
    def label(self) -> str:
        """The code, or else contact, pullback and plate mass: `PTFE 12 mm 22.4 kg`."""
        if self.code:
            return self.code
        pullback = "pullback unknown" if self.pullback_m is None else f"{self.pullback_m * 1e3:g} mm"
        return f"{self.contact or 'contact unknown'} {pullback} {self.plate_mass_kg:g} kg"

    @property
    def sort_key(self) -> tuple[bool, str, float, float, float, str]:
        """Order of the paper's table: contact, pullback from large to small, plate mass."""
        pullback = 0.0 if self.pullback_m is None else self.pullback_m
        return (not self.contact, self.contact, -pullback, self.plate_mass_kg, self.table_mass_kg, self.code)


@dataclass(frozen=True, eq=False, slots=True)
class RunResult:
    """Result of one run."""

    name: str  # path or label of the run
    series: SeriesKey
    results: dict[str, Quantity]  # by name; absent where undetermined. `plate_mass_kg` may be among them.
    budget: tuple[BudgetLine, ...] = ()  # lines of all results
    calibration_id: str = ""  # runs with the same calibrations share their errors
    stand_id: str = ""  # runs on the same stand share the errors of masses, gravity and clock
    adequate: bool | None = None  # the friction law explains the record; None where no law was fitted
    friction_holds: bool = False  # no model does, but independent estimates of f_d agree
    effects: tuple[str, ...] | None = None
    """Names of the effects of the stand in the model; None where none were looked for."""
    noise_m: float | None = None  # standard deviation of the readings; None where no law was fitted
    msk64_degree: str = ""  # "" where unknown
    excluded: str = ""  # why the run does not count; "" when it does
    warnings: tuple[ResultWarning, ...] = ()


_SAME_MASS = 1e-3  # relative difference up to which masses are equal: they are weighed to some grams
_NAMED = 5  # runs named in a message; further ones are counted


@dataclass(frozen=True, eq=False, slots=True)
class Series:
    """The runs of one row; `label` is unique among series."""

    label: str
    key: SeriesKey
    runs: tuple[RunResult, ...]


def group_into_series(runs: Sequence[RunResult]) -> list[Series]:
    """Sort runs into series, in the paper's order.

    Runs of one code form a series; runs without a code are grouped by contact, pullback and masses. Runs of
    one code that differ in these get a row each, labelled with the difference.
    """
    codes: dict[str, list[list[RunResult]]] = {}
    for run in runs:
        groups = codes.setdefault(run.series.label, [])
        group = next((each for each in groups if _same(each[0].series, run.series)), None)
        if group is None:
            groups.append([run])
        else:
            group.append(run)
    series = [
        Series(label + _distinction(group[0].series, groups), group[0].series, tuple(group))
        for label, groups in codes.items()
        for group in groups
    ]
    return sorted(series, key=lambda each: each.key.sort_key)


def campaign_warnings(runs: Sequence[RunResult], known_contacts: Sequence[str]) -> Iterator[ResultWarning]:
    """Warn of several calibrations, runs without a series, and unknown contacts."""
    count = len({run.calibration_id for run in runs})
    if count > 1:
        template = N_(
            "{count} calibrations were in use: their errors are taken as independent of each other."
        )
        yield result_warning("several-calibrations", template, count=count)
    if without := [run for run in runs if not run.series.code]:
        yield result_warning(
            "no-series",
            "{count} runs have no series ({run_names}): they are sorted by contact, pullback and masses."
            " Name it: slipstand edit RUN --series CODE",
            count=len(without),
            run_names=run_names(without),
        )
    unknown: dict[str, list[RunResult]] = {}
    for run in runs:
        if known_contacts and run.series.contact not in known_contacts:
            unknown.setdefault(run.series.contact, []).append(run)
    for contact, of_contact in unknown.items():
        yield result_warning(
            "unknown-contact",
            "contact {contact!r} ({run_names}) is not one of the stand ({known}). It gets rows of its"
            " own; name it in stand.toml",
            contact=contact or "not named",
            run_names=run_names(of_contact),
            known=", ".join(known_contacts),
        )


def run_names(runs: Sequence[RunResult]) -> str:
    """Names of some runs for a message, without their folders."""
    names = ", ".join(PurePath(run.name).name for run in runs[:_NAMED])
    return names if len(runs) <= _NAMED else f"{names} and {len(runs) - _NAMED} more"


def _same(one: SeriesKey, other: SeriesKey) -> bool:
    return (one.contact, one.pullback_m) == (other.contact, other.pullback_m) and all(
        math.isclose(a, b, rel_tol=_SAME_MASS)
        for a, b in ((one.plate_mass_kg, other.plate_mass_kg), (one.table_mass_kg, other.table_mass_kg))
    )


def _distinction(key: SeriesKey, groups: Sequence[Sequence[RunResult]]) -> str:
    """Difference between the runs of one label, as ` (m2 = 42.4 kg)`; "" without any."""
    keys = [group[0].series for group in groups]
    facts = (
        (f"m2 = {key.plate_mass_kg:g} kg", {other.plate_mass_kg for other in keys}),
        (f"m1 = {key.table_mass_kg:g} kg", {other.table_mass_kg for other in keys}),
        ("u0 unknown" if key.pullback_m is None else f"u0 = {key.pullback_m * 1e3:g} mm",
         {other.pullback_m for other in keys}),
        (key.contact or "contact unknown", {other.contact for other in keys}),
    )  # fmt: skip
    differing = [said for said, values in facts if len(values) > 1]
    return f" ({', '.join(differing)})" if differing else ""
