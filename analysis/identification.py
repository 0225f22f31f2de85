"""Result of an identification: numbers with uncertainties, the chosen law and its verdict, and warnings."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import TYPE_CHECKING, Self

import numpy as np

from analysis.arrays import Floats
from analysis.quantities import BudgetLine, Quantity, ResultWarning

if TYPE_CHECKING:  # which loads compiled code; windows show results without it
    from analysis.plate.friction import PlateFriction
    from analysis.preparation.free_decay import FreeDecay


@dataclass(frozen=True, slots=True)
class FittedModel:
    """One friction law as fitted, on an ideal stand or with effects of the stand."""

    name: str
    bic: float
    residual_rms_m: float
    friction_dynamic: float
    parts: tuple[str, ...] = ()  # names of the effects

    @property
    def full_name(self) -> str:
        return " + ".join((self.name, *self.parts))


class Degree(Enum):
    """How far a model explains a record; the value is its name in JSON."""

    IDEAL = "ideal"  # a friction law on an ideal stand leaves nothing but noise
    STAND = "stand"  # a friction law on a stand with the effects in `ModelSelection.parts` does
    FRICTION = "friction"  # no model does, but independent estimates of f_d agree; of T and n for one mass
    NONE = "none"  # f_d cannot be told; for one mass, T and n


@dataclass(frozen=True, slots=True)
class ModelSelection:
    """The chosen law, and whether it explains the record to within the noise."""

    name: str
    adequate: bool
    residual_rms_m: float
    noise_rms_m: float
    tried: tuple[FittedModel, ...] = ()
    degree: Degree = Degree.NONE
    parts: tuple[str, ...] = ()  # names of the effects of the stand in the chosen model
    residual_share: float | None = None  # residual_rms_m over the largest swing of gauge 1 (1)

    @property
    def full_name(self) -> str:
        return " + ".join((self.name, *self.parts))

    def with_friction(self, friction_dynamic: float) -> Self:
        """The same with f_d of the chosen model: with effects on friction it is a mean, and no parameter."""
        tried = tuple(
            replace(model, friction_dynamic=friction_dynamic) if model.full_name == self.full_name else model
            for model in self.tried
        )
        return replace(self, tried=tried)


def residual_share(residual_rms: float, readings: Floats) -> float:
    """Residual over the largest swing, half the range of the fitted `readings` (n,) (1)."""
    return residual_rms / max(0.5 * float(np.ptp(readings)), 1e-300)


@dataclass(frozen=True, slots=True)
class Events:
    """Times in the base of `Record.time_s`; None where the record does not hold the event."""

    release_s: float | None = None
    slip_end_s: float | None = None  # end of the last slip
    rest_s: float | None = None  # the swing is as small as the noise from here on
    free_decay_end_s: float | None = None
    """Last time that was fitted, where the free decay ends before the record."""
    release_uncertainty_s: float | None = None
    """Standard uncertainties from the readings; None where they are not known."""
    slip_end_uncertainty_s: float | None = None
    rest_uncertainty_s: float | None = None


@dataclass(frozen=True, eq=False, slots=True)
class Curves:
    """What the gauges should read, in the frame of the record: zeros, signs and gains included (m)."""

    table_displacement_m: Floats
    relative_displacement_m: Floats | None


@dataclass(frozen=True, eq=False, slots=True)
class MonteCarlo:
    """Result of the propagation of distributions, to compare with the budget."""

    draws: int  # through the linearised fit
    refits: int  # full fits
    linear: dict[str, Quantity]
    """The standard uncertainty is the scatter, the interval holds 95 % of the draws."""
    full: dict[str, Quantity]  # the same of the refits; empty without them
    agrees: dict[str, bool]
    """Whether the ends of the interval of the budget are met by those drawn (by the refits where there are
    any), within the tolerance."""
    tolerances: dict[str, float] = field(default_factory=dict)
    """Half a unit of the second digit of the standard uncertainty (JCGM 101, clause 8), and what the number
    of draws leaves open."""


@dataclass(frozen=True, eq=False, slots=True)
class Correlation:
    """Correlation of the errors of results."""

    names: tuple[str, ...]  # of the results (m)
    matrix: Floats  # (m, m) float64


@dataclass(frozen=True, eq=False)
class Identification:
    """Result of `identify`; the same values as `analyze --json`."""

    kind: str  # "two-mass" or "one-mass"
    results: dict[str, Quantity]  # by quantity (`analysis.catalogue`); what cannot be determined is absent
    labels: dict[str, str | bool] = field(default_factory=dict)
    """Results that are not numbers: msk64_degree, coulomb_significant."""
    model: ModelSelection | None = None  # None where no law of motion was fitted
    budget: list[BudgetLine] = field(default_factory=list)
    events: Events = Events()
    warnings: list[ResultWarning] = field(default_factory=list)  # "warnings" in the JSON
    parameters: dict[str, float] = field(default_factory=dict)
    """Fitted parameters of the motion: friction_dynamic, friction_static, stiffness_n_per_m,
    damping_coefficient_kg_per_s, pullback_m, tilt_rad, release_s, the masses and gravity used, and those of
    the chosen model alone under the names of its results."""
    curves: Callable[[Floats], Curves] | None = None  # fitted readings at given record times (n,)
    objective: Callable[[Floats], Floats] | None = None
    """Chi-square at given values of f_d (n,), f_s in the fitted ratio to it and all else as fitted."""
    curves_by_friction: Callable[[float, Floats], Curves] | None = None
    """Fitted readings with another f_d (float), at given record times (n,), all else as for `objective`."""
    monte_carlo: MonteCarlo | None = None  # where it was asked for
    plate: "PlateFriction | None" = None  # friction from the plate alone, slip by slip
    correlation: Correlation | None = None  # of those results whose errors are linear forms of a fit
    free_decay: "FreeDecay | None" = None  # what was found in the record before laws were fitted to it
