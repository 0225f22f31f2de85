"""What an effect that the plain Coulomb law does not know does to f_d, and whether it is noticed.

Each row is an effect and the bias to expect (orders of magnitude), on series 1FFM0 with f_d = 0.1 and 20 um
of noise. A row passes where the record is called inadequate, or f_d within 3 standard uncertainties.
"""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from analysis.arrays import Floats
from analysis.identify import identify
from analysis.motion.two_mass import TwoMassParameters
from analysis.record import AnalysisError, GaugeUncertainty, StandMasses
from analysis.synthetic import TABLE_MASS_KG, Truth, simulate_record
from benchmarks.studies import listed, options, spread_out, table

BASE = Truth(rate_hz=500.0, noise_m=2e-5)
STRIBECK = (0.02, 0.005)
"""f_s - f_d, and the velocity (m/s) over which it fades."""


@dataclass(frozen=True)
class Effect:
    """One row: what is true, and what of it is stated to the analysis."""

    name: str
    said: str
    truth: dict[str, Any] = field(default_factory=dict)
    stribeck: bool = False
    known: dict[str, Any] = field(default_factory=dict)


GAIN_STATED = GaugeUncertainty(gain_relative=0.01)
AS_STATED = StandMasses(TABLE_MASS_KG, BASE.plate_mass_kg)
EFFECTS = (
    Effect("none", ""),
    Effect("tilt 1 mrad", "+7.2 %, 422 um", {"tilt_rad": 1e-3}),
    Effect("f_s = 1.2 f_d", "+1.4 %", {"friction_static": 0.12}),
    Effect("f_s = 2 f_d", "+28 %, 458 um", {"friction_static": 0.2}),
    Effect("Stribeck +0.02 exp(-v / 5 mm/s)", "+3.8 %, 65 um", stribeck=True),
    Effect("gauge 2 late by 1 ms", "-0.75 %", {"lag_s": 1e-3}),
    Effect(
        "gauge 2 late by 1 ms, stated",
        "-0.75 %",
        {"lag_s": 1e-3},
        known={"relative_gauge": GaugeUncertainty(delay_s_uncertainty=1e-3)},
    ),
    Effect(
        "both gains +1 %, stated",
        "+1.0 %",
        {"gain_errors": (0.01, 0.01)},
        known={"table_gauge": GAIN_STATED, "relative_gauge": GAIN_STATED},
    ),
    Effect("m1 +1 %", "+0.12 %", {"table_mass_kg": 1.01 * TABLE_MASS_KG}),
    Effect(
        "m2 +1 %",
        "-0.12 %",
        {"plate_mass_kg": 1.01 * 22.4},
        known={"masses": StandMasses(TABLE_MASS_KG, 22.4)},
    ),
    Effect(
        "m1 +1 %, stated",
        "0.12 %",
        {"table_mass_kg": 1.01 * TABLE_MASS_KG},
        known={"masses": StandMasses(TABLE_MASS_KG, 22.4, table_mass_uncertainty_kg=0.01 * TABLE_MASS_KG)},
    ),
    Effect(
        "m2 +1 %, stated",
        "0.12 %",
        {"plate_mass_kg": 1.01 * 22.4},
        known={"masses": StandMasses(TABLE_MASS_KG, 22.4, plate_mass_uncertainty_kg=0.01 * 22.4)},
    ),
    Effect("gauge 2 drift 20 um/s", "+0.1 %", {"drift_m_per_s": 2e-5}),
)


@dataclass(frozen=True)
class Outcome:
    """One record: f_d by the plain law and by choice, both relative to the true one."""

    seed: int
    plain: float = math.nan
    plain_rms_m: float = math.nan
    law: str = "refused"
    off: float = math.nan
    deviation: float = math.nan
    adequate: bool = False

    @property
    def passed(self) -> bool:
        """Noticed, or right."""
        return not self.adequate or abs(self.deviation) <= 3.0


@dataclass(frozen=True)
class StribeckMotion:
    """Motion under f = f_d + extra exp(-|w| / fading), by DOP853 from event to event.

    States are (u1, u1', rel, rel'). With `extra` zero it must agree with the exact solver.
    """

    truth: Truth
    extra: float = STRIBECK[0]
    fading_m_per_s: float = STRIBECK[1]

    @cached_property
    def parameters(self) -> TwoMassParameters:
        """The stand and contact."""
        return self.truth.parameters()

    @cached_property
    def pieces(self) -> tuple[list[float], list[Any]]:
        """Begins of the phases, and their dense solutions."""
        starts, solutions = [], []
        time, state, must_stick = 0.0, np.array([self.parameters.pullback_m, 0.0, 0.0, 0.0]), False
        while time < self.truth.duration_s:
            sign = (
                0.0 if must_stick or self._excess(state) < -1e-9 else -math.copysign(1.0, self._pull(state))
            )
            state[3] = 1e-12 * sign  # a slip starts off the standstill that would end it at once
            solved = solve_ivp(
                partial(self._slip, sign) if sign else self._stick,
                (time, self.truth.duration_s + 1e-6), state,
                "DOP853", events=self._end(sign), dense_output=True, rtol=1e-10, atol=1e-13, max_step=0.005,
            )  # fmt: skip
            starts.append(time)
            solutions.append(solved.sol)
            time, state = float(solved.t[-1]), solved.y[:, -1].copy()
            must_stick = sign != 0.0 and self._excess(state) < 0.0
        return starts, solutions

    def displacements(self, since_s: Floats) -> tuple[Floats, Floats]:
        """u1 and u2 - u1 (n,) at times (n,) from release, negative before it."""
        starts, solutions = self.pieces
        after_s = np.maximum(since_s, 0.0)
        which = np.searchsorted(starts, after_s, side="right") - 1
        both = np.empty((2, len(since_s)))
        for k in np.unique(which):
            both[:, which == k] = solutions[k](after_s[which == k])[[0, 2]]
        return both[0], both[1]

    def _pull(self, y: Floats) -> float:
        p = self.parameters
        return float(-p.damping_coefficient_kg_per_s * y[1] - p.stiffness_n_per_m * y[0])

    def _excess(self, y: Floats) -> float:
        """Joint acceleration beyond what static friction gives the plate."""
        p = self.parameters
        joint = abs(self._pull(y)) / (p.table_mass_kg + p.plate_mass_kg)
        return joint - p.gravity_m_per_s2 * (p.friction_dynamic + self.extra)

    def _stick(self, _: float, y: Floats) -> list[float]:
        p = self.parameters
        return [y[1], self._pull(y) / (p.table_mass_kg + p.plate_mass_kg), 0.0, 0.0]

    def _slip(self, sign: float, _: float, y: Floats) -> list[float]:
        p = self.parameters
        friction = p.friction_dynamic + self.extra * math.exp(-abs(y[3]) / self.fading_m_per_s)
        plate = -sign * p.gravity_m_per_s2 * friction
        table = (self._pull(y) - p.plate_mass_kg * plate) / p.table_mass_kg
        return [y[1], table, y[3], plate - table]

    def _end(self, sign: float) -> Callable[[float, Floats], float]:
        def end(_: float, y: Floats) -> float:
            return sign * float(y[3]) if sign else self._excess(y)

        end.terminal, end.direction = True, -1.0 if sign else 1.0  # type: ignore[attr-defined]
        return end


def run(job: int, seed: int) -> Outcome:
    """Identify one record under effect number `job % len(EFFECTS)`."""
    effect, number = EFFECTS[job % len(EFFECTS)], seed + job // len(EFFECTS)
    rng = np.random.default_rng((number, 3))
    truth = BASE.replace(**effect.truth, release_phase=float(rng.random()), seed=number)
    made = simulate_record(
        truth, StribeckMotion(truth).displacements if effect.stribeck else None, **effect.known
    )
    plain, plain_rms = math.nan, math.nan
    try:
        coulomb = identify(made, model="coulomb")
        plain = coulomb.results["friction_dynamic"].value / truth.friction_dynamic - 1.0
        plain_rms = coulomb.model.residual_rms_m if coulomb.model else math.nan
        found = identify(made)
    except AnalysisError:
        return Outcome(number, plain, plain_rms)
    result, model = found.results.get("friction_dynamic"), found.model
    if result is None or model is None:
        return Outcome(number, plain, plain_rms, "no f_d")
    off = result.value - truth.friction_dynamic
    return Outcome(
        number, plain, plain_rms, model.name, off / truth.friction_dynamic, off / result.standard_uncertainty,
        model.adequate,
    )  # fmt: skip


def row(effect: Effect, outcomes: list[Outcome]) -> tuple[object, ...]:
    """One line of the table."""
    laws = Counter(outcome.law for outcome in outcomes)
    deviations = [outcome.deviation for outcome in outcomes]
    return (
        effect.name,
        effect.said,
        f"{100.0 * float(np.nanmedian([outcome.plain for outcome in outcomes])):+.2f} %",
        f"{1e6 * float(np.nanmedian([outcome.plain_rms_m for outcome in outcomes])):.0f} um",
        ", ".join(f"{law} {count}" for law, count in laws.most_common()),
        sum(outcome.adequate for outcome in outcomes),
        f"{100.0 * float(np.nanmedian([outcome.off for outcome in outcomes])):+.3f} %",
        f"{float(np.nanmedian(deviations)):+.1f} ({float(np.nanmax(np.abs(deviations))):.1f})",
        f"{sum(outcome.passed for outcome in outcomes)} of {len(outcomes)}",
        listed([outcome.seed for outcome in outcomes if not outcome.passed]),
    )


HEADER = (
    "what is true",
    "to expect",
    "plain law: bias",
    "its rms",
    "laws chosen",
    "adequate",
    "chosen: bias",
    "in u (most)",
    "noticed or right",
    "not so (seeds)",
)


def main() -> None:
    """Run and print the table."""
    chosen = options(__doc__ or "", 20)
    jobs = range(chosen.records * len(EFFECTS))
    outcomes = spread_out(partial(run, seed=chosen.seed), jobs, chosen.workers, "wrong models")
    rows = [row(effect, outcomes[k :: len(EFFECTS)]) for k, effect in enumerate(EFFECTS)]
    print(f"### {chosen.records} records of 1FFM0 for each effect\n")
    print(table(HEADER, rows))


if __name__ == "__main__":
    main()
