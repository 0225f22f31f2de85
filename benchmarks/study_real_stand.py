"""Whether f_d holds on stands that are not ideal, and whether the identification names what is wrong.

Each record has one of the effects of `benchmarks.real_effects`, half of them with milder ones beside it, on
one of 8 series of Table 1, with 5, 20 or 50 um of noise, simulated by `benchmarks.real_stand`. The true f_d
is the mean of the friction coefficient over the slid path.
"""

import csv
import math
import os
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path

import numpy as np

from analysis.identification import Identification
from analysis.identify import identify, warm_up
from analysis.laws.stand_parts import EFFECTS as STAND_EFFECTS
from analysis.record import AnalysisError
from analysis.results.diagnosis import SENTENCES
from benchmarks.real_effects import EFFECTS, STATIC, draw_scene
from benchmarks.real_record import simulate
from benchmarks.studies import each_outcome, option_parser, percent, table

HOLDS = ("ideal", "stand", "friction")
"""Degrees of the verdict that stand for an f_d that holds."""
SEEN = 5.0  # a slip is seen whose path is that many standard deviations of the noise
SLIPS = 3  # from which on a record is judged
TOLD = 100  # records from which a share is given in percent
CLOSE, WRONG, COVERED = 0.01, 0.005, 3.0
"""Relative deviations of f_d that are close enough and wrong; standard uncertainties that cover."""


@dataclass(frozen=True)
class Outcome:
    """One record: a line of the CSV file."""

    number: int
    effect: str
    group: str
    strength: float
    others: str
    series: str
    noise_um: float
    rate_hz: float
    stated: bool
    slips: int
    truth: float
    friction: float = math.nan
    uncertainty: float = math.nan
    plate: float = math.nan
    plate_uncertainty: float = math.nan
    law: str = ""
    adequate: bool = False
    degree: str = ""
    residual_share: float = math.nan
    parts: str = ""
    codes: str = ""
    is_nameable: bool = False
    is_named: bool = False
    is_misnamed: bool = False
    seconds: float = math.nan  # of the processor: others may keep it busy
    failure: str = ""

    @property
    def off(self) -> float:
        """Relative deviation of f_d; infinite without one."""
        return _off(self.friction, self.truth)

    @property
    def is_covered(self) -> bool:
        """Whether the truth lies within 3 u."""
        return abs(self.friction - self.truth) <= COVERED * self.uncertainty

    @property
    def is_plate_covered(self) -> bool:
        """The same of the estimate from the plate alone."""
        return abs(self.plate - self.truth) <= COVERED * self.plate_uncertainty

    @property
    def is_called(self) -> bool:
        """Whether the verdict lets f_d stand."""
        return self.adequate or self.degree in HOLDS

    @property
    def is_silently_wrong(self) -> bool:
        """Called, and off by more than 3 u and 0.5 %."""
        return self.is_called and not self.is_covered and self.off > WRONG


def _off(value: float, truth: float) -> float:
    return abs(value / truth - 1.0) if math.isfinite(value) else math.inf


def run(number: int, effects: tuple[int, ...], cache: Path | None) -> Outcome:
    """Simulate and identify one record."""
    effect = EFFECTS[effects[number % len(effects)]]
    scene, strength, others = draw_scene(effect, number)
    simulated = simulate(scene, cache)
    slips = int(np.sum(simulated.slips_m > SEEN * scene.noise_m))
    truth = partial(
        Outcome, number, effect.name, effect.group, strength, "; ".join(other.name for other in others),
        scene.series, 1e6 * scene.noise_m, scene.rate_hz, scene.gain_uncertainty is not None, slips,
        simulated.friction_dynamic,
    )  # fmt: skip
    if not _warm:
        warm_up()
        _warm.append(True)
    begun = time.process_time()
    try:
        found = identify(simulated.record)
    except AnalysisError as error:
        return truth(seconds=time.process_time() - begun, failure=str(error))
    except Exception as error:  # a crash is an outcome
        return truth(seconds=time.process_time() - begun, failure=f"crash: {error!r}")
    seconds = time.process_time() - begun
    parts, laws = _named(found)
    true_names = effect.named.union(*(other.named for other in others))
    friction = "friction_path_mean" if "friction_path_mean" in found.results else "friction_dynamic"
    values = [
        (quantity.value, quantity.standard_uncertainty) if quantity else (math.nan, math.nan)
        for quantity in map(found.results.get, (friction, "friction_dynamic_plate"))
    ]
    model = found.model
    return truth(
        *(number for pair in values for number in pair),
        law=model.name if model else "",
        adequate=model.adequate if model else False,
        degree=_degree(found),
        residual_share=getattr(model, "residual_share", None) or math.nan,
        parts=" ".join(sorted(parts)),
        codes=" ".join(warning.code for warning in found.warnings),
        is_nameable=bool(effect.named),
        is_named=bool(effect.named & (parts | laws)),
        is_misnamed=bool(parts - true_names - STATIC),
        seconds=seconds,
    )


_warm: list[bool] = []


def _degree(found: Identification) -> str:
    degree = getattr(found.model, "degree", "")
    return str(getattr(degree, "value", degree) or "")


def _named(found: Identification) -> tuple[set[str], set[str]]:
    """Effects of the stand that the identification names by a warning, and parts of its friction law."""
    if found.model is None:
        return set(), set()
    named = {warning.code for warning in found.warnings} & {effect.name for effect in STAND_EFFECTS}
    silent = set(found.model.parts) & {code for code, sentence in SENTENCES.items() if not sentence}
    return named | silent, set(found.model.name.split("+"))


# Summary


HEADER = (
    "", "records", "f_d within 1 %", "within 3 u", "median off", "90 % off", "called adequate or holding",
    "called, off by > 3 u and 0.5 %", "named", "misnamed", "plate within 1 %", "plate within 3 u",
    "without f_d", "processor time: median, p99, longest (s)",
)  # fmt: skip


def summary(outcomes: list[Outcome]) -> str:
    """Tables by effect, group and noise, and in total; of f_d among records with three slips or more."""

    def rows(key: Callable[[Outcome], str]) -> list[tuple[str, ...]]:
        keys = dict.fromkeys(key(outcome) for outcome in outcomes)
        return [_row(name, [each for each in outcomes if key(each) == name]) for name in keys]

    crashes = [f"{each.number}: {each.failure}" for each in outcomes if each.failure.startswith("crash")]
    silent = sorted((each for each in outcomes if each.is_silently_wrong), key=lambda each: -each.off)
    listed = [
        f"{each.number} ({', '.join(filter(None, (each.effect, each.others)))}; {100.0 * each.off:.1f} %,"
        f" {each.law} {each.degree} {each.parts})"
        for each in silent[:20]
    ]
    return "\n\n".join(
        (
            table(HEADER, [_row("all", outcomes), *rows(lambda each: f"{each.noise_um:.0f} um")]),
            table(HEADER, rows(lambda each: each.group)),
            table(HEADER, sorted(rows(lambda each: f"{each.group}: {each.effect}"))),
            f"Crashes: {'; '.join(crashes[:10]) or 'none'}.",
            f"Called and wrong: {'; '.join(listed) or 'none'}.",
        )
    )


def _row(name: str, outcomes: list[Outcome]) -> tuple[str, ...]:
    judged = [each for each in outcomes if each.slips >= SLIPS]
    off = np.sort([each.off for each in judged])
    seconds = np.array([each.seconds for each in outcomes])
    return (
        name,
        f"{len(outcomes)} ({len(judged)})",
        _share(each.off <= CLOSE for each in judged),
        _share(each.is_covered for each in judged),
        *(f"{100.0 * off[int(share * len(off))]:.2f} %" if len(off) else "" for share in (0.5, 0.9)),
        _share(each.is_called for each in outcomes),
        _share(each.is_silently_wrong for each in outcomes),
        _share(each.is_named for each in outcomes if each.is_nameable),
        _share(each.is_misnamed for each in outcomes),
        _share(_off(each.plate, each.truth) <= CLOSE for each in judged),
        _share(each.is_plate_covered for each in judged),
        str(sum(not math.isfinite(each.friction) for each in judged)),
        f"{np.median(seconds):.2f}, {np.quantile(seconds, 0.99):.2f}, {seconds.max():.2f}",
    )


def _share(flags: Iterable[bool]) -> str:
    """Share, with its standard error where it tells something."""
    known = list(flags)
    return percent(sum(known), len(known)) if len(known) >= TOLD else f"{sum(known)} of {len(known)}"


def read(path: Path) -> list[Outcome]:
    """Outcomes of a CSV file that this study wrote."""
    kinds = {each.name: each.type for each in fields(Outcome)}
    convert = {float: float, int: int, str: str, bool: lambda text: text == "True"}
    with path.open(newline="", encoding="utf-8") as file:
        return [
            Outcome(**{name: convert[kinds[name]](text) for name, text in line.items()})  # type: ignore[index, operator]
            for line in csv.DictReader(file)
        ]


def main() -> None:
    """Run, write the CSV file, and print the tables."""
    parser = option_parser(__doc__ or "", 2000)
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write the outcomes, one a line")
    parser.add_argument("--cache", type=Path, metavar="FOLDER", help="keep the simulated records there")
    parser.add_argument("--effect", default="", metavar="TEXT", help="only effects whose name holds this")
    parser.add_argument("--read", type=Path, metavar="FILE", help="only summarize such a CSV file")
    chosen = parser.parse_args()
    if chosen.read:
        print(summary(read(chosen.read)))
        return
    if chosen.cache:
        chosen.cache.mkdir(parents=True, exist_ok=True)
    effects = tuple(
        n for n, effect in enumerate(EFFECTS) if chosen.effect in f"{effect.group}: {effect.name}"
    )
    numbers = range(chosen.seed, chosen.seed + chosen.records)
    outcomes = []
    with Path(chosen.csv or os.devnull).open("w", newline="", encoding="utf-8", buffering=1) as file:
        writer = csv.writer(file)
        names = [each.name for each in fields(Outcome)]
        writer.writerow(names)
        work = partial(run, effects=effects, cache=chosen.cache)
        for outcome in each_outcome(work, numbers, chosen.workers, "real stand"):
            writer.writerow([getattr(outcome, name) for name in names])
            outcomes.append(outcome)
    print(summary(outcomes))


if __name__ == "__main__":
    main()
