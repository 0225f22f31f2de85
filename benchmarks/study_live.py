"""Whether T, n1 and f_d that are shown while a test runs hold, and agree with the final ones.

Each simulated test is followed as it would be at the stand, and stopped at a random moment after the release.
What was shown last is compared with the truth and with the whole identification of the same samples. Ideal
stands are those of `study_coverage`, with everything known exactly or off their stated values by draws from
their distributions; the others have an effect of `benchmarks.real_effects` each, half of them milder ones
beside it, and are simulated by `benchmarks.real_stand`.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from analysis.averaging import average_record
from analysis.identification import Identification
from analysis.identify import identify
from analysis.laws.stand_parts import EFFECTS as STAND_EFFECTS
from analysis.live import LiveIdentification, LiveState
from analysis.quantities import COVERAGE_FACTOR_95, Quantity
from analysis.record import AnalysisError, GaugeUncertainty, Record, StandMasses
from analysis.synthetic import TABLE_MASS_KG, Truth, simulate_record
from benchmarks.real_effects import EFFECTS, draw_scene
from benchmarks.real_record import simulate
from benchmarks.studies import listed, options, percent, spread_out, table
from benchmarks.study_coverage import CLOCK, GAIN, GRAVITY, LAG_S, PLATE_KG, TABLE_KG, disturbed, draw

QUANTITIES = {"friction": "f_d", "plate": "f_d of the plate, before it", "period": "T", "damping": "n1"}
_UPDATE_S = 0.05
_EARLIEST_S, _LATEST_S = 0.5, 10.0  # of a stop, after the release
_BENDING = {effect.name for effect in STAND_EFFECTS if effect.bends_tail}
_FAR = 4.0  # standard uncertainties from which on a record is named


@dataclass(frozen=True)
class Told:
    """One quantity as shown last and as found in the end, with their standard uncertainties; NaN: neither."""

    live: float
    live_u: float
    final: float
    final_u: float
    truth: float

    @property
    def off(self) -> float:
        """Error of what was shown over its uncertainty."""
        return (self.live - self.truth) / self.live_u

    @property
    def final_off(self) -> float:
        """Error of what was found over its uncertainty."""
        return (self.final - self.truth) / self.final_u


@dataclass(frozen=True)
class Stopped:
    """A test that was stopped; what was told, by the names in QUANTITIES."""

    seed: int
    stop_s: float  # after the release
    told: dict[str, Told]
    adequate: bool = False
    failure: str = ""


def run(seed: int, make: Callable[[int, float], tuple[Record, dict[str, float]]]) -> Stopped:
    """Follow one test until it is stopped, and identify what was recorded."""
    stop_s = float(np.random.default_rng((seed, 20)).uniform(_EARLIEST_S, _LATEST_S))
    record, truths = make(seed, stop_s)
    shown = follow(record)
    try:
        final = identify(record)
    except AnalysisError as error:
        return Stopped(seed, stop_s, {}, failure=str(error))
    told = {name: _told(*pair, truths[name]) for name, pair in _pairs(shown, final).items()}
    return Stopped(seed, stop_s, told, final.model is not None and final.model.adequate)


def exactly_known(seed: int, stop_s: float) -> tuple[Record, dict[str, float]]:
    """Record until the stop, on an ideal stand of which all is known, and the true values."""
    truth = draw(seed)[0].replace(duration_s=stop_s)
    return simulate_record(truth), _truths(truth)


def off_its_stated_values(seed: int, stop_s: float) -> tuple[Record, dict[str, float]]:
    """The same on a stand that is off its stated values."""
    nominal, _ = draw(seed)
    truth = disturbed(nominal).replace(duration_s=stop_s)
    record = simulate_record(
        truth,
        masses=StandMasses(TABLE_MASS_KG, nominal.plate_mass_kg, TABLE_KG, PLATE_KG, 9.81, GRAVITY),
        clock_scale_uncertainty=CLOCK,
        table_gauge=GaugeUncertainty(gain_relative=GAIN),
        relative_gauge=GaugeUncertainty(gain_relative=GAIN, delay_s_uncertainty=LAG_S),
    )
    return record, _truths(truth)


def _truths(truth: Truth) -> dict[str, float]:
    """True values by the names in QUANTITIES."""
    friction = dict.fromkeys(("friction", "plate"), truth.friction_dynamic)
    return {**friction, "period": truth.period_s, "damping": truth.damping_n1_per_s}


def not_ideal(seed: int, stop_s: float) -> tuple[Record, dict[str, float]]:
    """The same on a stand with effects; those that bend the tail leave no one true period and damping."""
    effect = EFFECTS[seed % len(EFFECTS)]
    scene, _, others = draw_scene(effect, seed)
    made = simulate(replace(scene, duration_s=stop_s))
    friction = dict.fromkeys(("friction", "plate"), made.friction_dynamic)
    stand, bends = scene.stand, _BENDING & effect.named.union(*(other.named for other in others))
    values = {"period": stand.period_s, "damping": stand.damping_n1_per_s}
    return made.record, friction | (dict.fromkeys(values, math.nan) if bends else values)


def follow(record: Record) -> LiveState:
    """What is shown at the end of a record that is followed from its beginning."""
    record, live = average_record(record), LiveIdentification()
    end_s = float(record.time_s[-1])
    state = LiveState(end_s)
    for now_s in np.arange(end_s % _UPDATE_S, end_s + 0.5 * _UPDATE_S, _UPDATE_S):
        state = live.update(_until(record, float(now_s) + 1e-9))
    return state


def _until(record: Record, time_s: float) -> Record:
    rows = slice(int(np.searchsorted(record.time_s, time_s, side="right")))
    relative = record.relative_displacement_m
    return record.replace(
        time_s=record.time_s[rows],
        table_displacement_m=record.table_displacement_m[rows],
        relative_displacement_m=None if relative is None else relative[rows],
    )


def _pairs(shown: LiveState, final: Identification) -> dict[str, tuple[Quantity | None, Quantity | None]]:
    """What was shown last and what was found in the end."""
    results = final.results
    friction = results.get("friction_path_mean", results.get("friction_dynamic"))
    return {
        "friction": (shown.friction_dynamic, friction),
        "plate": (shown.friction_dynamic_plate, friction),
        "period": (shown.period_s, results.get("period_s")),
        "damping": (shown.damping_n1_per_s, results.get("damping_n1_per_s")),
    }


def _told(live: Quantity | None, final: Quantity | None, truth: float) -> Told:
    known = [
        (math.nan, math.nan) if each is None else (each.value, each.standard_uncertainty)
        for each in (live, final)
    ]
    return Told(*known[0], *known[1], truth)


MADE = {
    "Ideal stands, noise alone": exactly_known,
    "Ideal stands, whole budget": off_its_stated_values,
    "Stands that are not ideal": not_ideal,
}
HEADER = (
    "", "shown", "shown within 1.96 u", "found within 1.96 u", "mean square of shown - true, u",
    "u shown over u found: median, 5 to 95 %", "shown and found differ by more than u found",
    "beyond 4 u (seeds)",
)  # fmt: skip


def report(title: str, stopped: list[Stopped]) -> str:
    """Table of the tests that were followed."""
    failed = [each for each in stopped if each.failure]
    lines = [
        f"### {title}: {len(stopped)} tests",
        table(HEADER, [_row(name, stopped) for name in QUANTITIES]),
        "",
        f"- without a result: {len(failed)}; " + "; ".join(f"{each.seed} {each.failure}" for each in failed),
        "",
    ]
    return "\n".join(lines)


def _row(name: str, stopped: list[Stopped]) -> tuple[str, ...]:
    shown = [(each.seed, each.told[name]) for each in stopped if each.told]
    shown = [(seed, told) for seed, told in shown if math.isfinite(told.live)]
    both = [told for _, told in shown if math.isfinite(told.final)]
    ratios = np.array([told.live_u / told.final_u for told in both])
    judged = [(seed, told) for seed, told in shown if math.isfinite(told.truth)]
    off = np.array([told.off for _, told in judged])
    return (
        QUANTITIES[name],
        str(len(shown)),
        _share((abs(told.off) <= COVERAGE_FACTOR_95 for _, told in judged)),
        _share(abs(told.final_off) <= COVERAGE_FACTOR_95 for _, told in judged if math.isfinite(told.final)),
        f"{np.mean(off**2):.2f}" if len(off) else "",
        "{:.2f}, {:.2f} to {:.2f}".format(*np.quantile(ratios, (0.5, 0.05, 0.95))) if len(ratios) else "",
        _share(abs(told.live - told.final) > told.final_u for told in both),
        listed([seed for seed, told in judged if abs(told.off) > _FAR]),
    )


def _share(flags: Iterable[bool]) -> str:
    known = list(flags)
    return percent(sum(known), len(known))


def main() -> None:
    """Follow tests on ideal stands and on others, and print their tables."""
    chosen = options(__doc__ or "", 200)
    seeds = range(chosen.seed, chosen.seed + chosen.records)
    for title, make in MADE.items():
        work = partial(run, make=make)
        print(report(title, spread_out(work, seeds, chosen.workers, title)), flush=True)


if __name__ == "__main__":
    main()
