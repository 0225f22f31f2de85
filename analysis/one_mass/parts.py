"""Parts beyond linear stiffness, viscous and Coulomb damping, added to a fit of one mass by evidence."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from analysis.one_mass.fit import (
    COULOMB,
    DAMPING,
    OneMassFit,
    Parameters,
    envelope,
    fit,
    gradient,
    used_places,
    within_bounds,
)
from analysis.record import RecordError
from messages.i18n import N_

_EVIDENCE = 10.0  # fall of BIC that is very strong evidence (Kass and Raftery 1995)
_CLOSE = 0.02  # residual, of the swing, above which the first order says little
_SIGMAS = 3.0  # of each part above its uncertainty
_MEAN_TIMES = 400  # at which the swing is taken for the mean damping
_MEAN_TRIALS = 8  # steps of Gauss and Newton towards it
_TRIALS = 2  # parts that are fitted in each round: those with the best first-order scores


@dataclass(frozen=True, slots=True)
class Part:
    """A deviation from linear stiffness and viscous damping, with one parameter."""

    name: str  # code of the warning that names it
    place: int  # of its parameter
    bends_spring: bool  # it changes the stiffness; a model holds one part of a kind
    result: str  # quantity of the catalogue
    size: Callable[[Parameters], float]  # value of that quantity
    text: str  # template of the warning
    rarity: float = 0.0  # added to the BIC: what stands rarely are must explain more


def _pendulum_rise(parameters: Parameters) -> float:
    """Relative rise of the secant stiffness at the first swing."""
    return float(np.sinc(parameters.turning * math.sqrt(max(0.0, parameters.sine)) / math.pi)) - 1.0


PARTS = (
    Part("spring-hardening", 6, True, "spring_hardening", lambda p: p.cubic * p.turning**2,
         N_("the stiffness changes by {size} at the first swing: T is that of small swings.")),
    Part("pendulum", 7, True, "spring_hardening", _pendulum_rise,
         N_("it swings like a pendulum, whose stiffness changes by {size} at the first swing:"
            " T is that of small swings."), rarity=6.0),
    Part("drag", 8, False, "drag_per_m", lambda p: p.drag,
         N_("damping grows with the velocity, by quadratic drag of {size}: n is that of small swings.")),
    Part("damping-rise", 9, False, "damping_rise", lambda p: 0.25 * p.rise * p.turning**2,
         N_("damping grows with the square of the swing, by {size} at the first swing:"
            " n is that of small swings.")),
)  # fmt: skip


def parts_of(parameters: Parameters) -> tuple[Part, ...]:
    """Parts that a fit holds."""
    return tuple(part for part in PARTS if parameters[part.place] != 0.0)


def mean_damping(parameters: Parameters, start_s: float, end_s: float) -> float:
    """Damping constant (1/s) of the exponential nearest to the swing between two times.

    Dry friction is left out. It is what a fit with viscous damping alone gives: n of the swings that count
    most in least squares.
    """
    time_s = np.linspace(start_s, end_s, _MEAN_TIMES)
    swing = envelope(parameters._replace(coulomb=0.0), time_s)
    since_s, damping, first = time_s - start_s, math.log(swing[0] / swing[-1]) / (end_s - start_s), swing[0]
    for _ in range(_MEAN_TRIALS):
        fading = np.exp(-damping * since_s)
        columns = np.column_stack((fading, -first * since_s * fading))
        steps = np.linalg.lstsq(columns, swing - first * fading, rcond=None)[0]
        first, damping = first + steps[0], damping + steps[1]
    return float(damping)


def parts_are_clear(found: OneMassFit) -> bool:
    """Tell whether each part is well above its uncertainty, correlated noise included."""
    limit = _SIGMAS * math.sqrt(found.noise_factor)
    places = (part.place for part in parts_of(found.parameters))
    return all(abs(found.parameters[place]) > limit * found.uncertainty(place) for place in places)


def add_parts(found: OneMassFit) -> OneMassFit:
    """Add one part after another for as long as the BIC falls clearly; `found` itself where none helps.

    x_k and n come out on either side of zero, but fits are compared with what is clearly negative at 0.
    """
    best = _Candidate(found)
    while True:
        kinds = {part.bends_spring for part in parts_of(best.free.parameters)}
        others = [part for part in PARTS if part.bends_spring not in kinds]
        scores = {part.name: _score(best.bounded, part) for part in others}
        if best.bounded.rms < _CLOSE * float(np.ptp(best.bounded.channel.value_m)):
            others = [part for part in others if best.gains(scores[part.name])]
        others.sort(key=lambda part: scores[part.name])
        trials = [trial for part in others[:_TRIALS] if (trial := _with_part(best, part)) is not None]
        if not trials:
            return best.free
        richer = min(trials, key=lambda trial: trial.bic)
        if not (best.gains(richer.bounded.cost) and richer.gains(richer.bounded.cost, best.bounded.cost)):
            return best.free
        best = richer


class _Candidate:
    """A fit, and the same within its bounds if x_k or n is clearly negative."""

    def __init__(self, free: OneMassFit) -> None:
        self.free = self.bounded = free
        if free.is_negative(COULOMB) or free.is_negative(DAMPING):
            self.bounded = within_bounds(free)
        self.effective = len(free.residual) / self.bounded.noise_factor

    @property
    def bic(self) -> float:
        """Bayesian information criterion, but for the number of parts."""
        rarity = sum(part.rarity for part in parts_of(self.free.parameters))
        return self.effective * math.log(max(self.bounded.cost, 1e-300)) + rarity

    def gains(self, lower: float, cost: float = 0.0) -> bool:
        """Tell whether one more parameter and the cost `lower` in place of `cost` lower the BIC clearly."""
        fall = self.effective * math.log((cost or self.bounded.cost) / max(lower, 1e-300))
        return fall > math.log(max(self.effective, 1.0)) + _EVIDENCE


def _score(found: OneMassFit, part: Part) -> float:
    """Cost that the part would leave, to first order."""
    places = used_places(found.parameters, part.place)
    columns = gradient(found.parameters, found.channel.time_s, found.order, places)
    if not np.isfinite(columns).all():
        return math.inf
    columns /= np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    left = found.residual - columns @ np.linalg.lstsq(columns, found.residual, rcond=None)[0]
    return float(left @ left)


def _with_part(best: _Candidate, part: Part) -> _Candidate | None:
    """Fit with one more part; None where that fails, or damping would fall with the velocity."""
    start = best.bounded
    try:
        richer = _Candidate(fit(start.channel, start.parameters, start.order, parts=(part.place,)))
    except (RecordError, np.linalg.LinAlgError):
        return None
    return None if richer.bounded.parameters.drag < 0.0 else richer
