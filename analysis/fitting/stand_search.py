"""Search for deviations from the ideal stand that explain what no friction law alone explains.

Effects are added one at a time, each by its evidence. A score test about the present fit tells how much
chi-square each could take; the first few are fitted; the best stays if the BIC falls clearly. The motion is
followed in time as in `analysis.fitting.search`: a short window after the release first, then to the end of
slip, then the whole record.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from analysis.arrays import Floats
from analysis.fitting.problem import (
    FitProblem,
    GaussNewton,
    Minimum,
    QuadraticModel,
    covariance,
    project_to_bounds,
)
from analysis.fitting.search import Fit, Search, fit_at_minimum
from analysis.laws.catalogue import PARAMETER_COUNT
from analysis.laws.law import FrictionLaw
from analysis.laws.parameters import Parameter
from analysis.laws.stand_parts import (
    EFFECTS,
    STATIC_FRICTION,
    StandEffect,
    StandModel,
    compose,
    effects_by_name,
    extended_point,
    motion_count,
)
from analysis.motion.stand_motion import (
    INTEGRATION_ERROR_M,
    STAND_PARAMETER_COUNT,
    StandParameter,
    filter_step_s,
)
from analysis.preparation.channels import Channel
from analysis.preparation.oscillation import DampedCosine

_WINDOWS_PERIODS = (2.5, 6.0, 12.0)  # after the release; then the whole record
_READINGS = 500  # a channel in a window: as many as searches for friction laws take
_READINGS_WHOLE = 1500  # a channel of the whole record
_EFFECTS_MOST = 4  # that explain one record: more would explain anything
_TRIED = 2  # effects that are fitted of those whose start points are best
_TRIED_BY_PROMISE = 2  # the same of those that a linear motion promises most of
_FREQUENCIES = (StandParameter.MODE_FREQUENCY, StandParameter.BASE_FREQUENCY)
_FILTERS = (StandParameter.FILTER, StandParameter.FILTER_2)
_BASE_HARMONICS = (2.0, 3.5, 6.0, 10.0)  # frequencies of a base over the first: it is heavier and stiffer
_MODE_DAMPING = 0.01  # damping ratio of a bolted joint
_STEP_SHARES = (1.0, 0.3)  # of a linear step that are tried: phases of fast motions are far from linear
_MASSES = (Parameter.TABLE_MASS, Parameter.PLATE_MASS)
_BASE_DAMPING = 0.03  # damping ratio of a base on the ground or on a floor
_CREEP_S = 5.0  # time constant of a gauge that warms up or creeps: seconds
_SECOND_ORDER = {
    StandParameter.MODE_DAMPING: _MODE_DAMPING,
    StandParameter.BASE_DAMPING: _BASE_DAMPING,
    StandParameter.CREEP_1_TIME: _CREEP_S,
    StandParameter.CREEP_2_TIME: _CREEP_S,
}
"""Parameters without effect to first order, and where a fit begins."""
_EFFORT_MAX = 1.2e6
"""Steps of integration after which a search adds no effect and follows only the best: 1 s of a core."""
_STEPS_A_PERIOD = 75.0  # of motions with two slips a period ...
_STEPS_A_CYCLE = 20.0  # ... and of a second oscillator
_STEPS_A_GRID_POINT = 0.4  # of a filtered motion: what it costs, by profile
_STEPS_A_READING = 0.1  # the same
_READINGS_MISSING = 12_000  # a channel in which effects are looked for that a fit may miss
_PRIOR_ODDS = 0.005
"""Of each effect. With it intervals of clean records widen by 1 % (median of 25), with 0.05 by 8 %."""
_LOG_WEIGHT_MAX = 50.0  # more is certain
_BASE_HARMONIC = 3.5  # frequency over the first of a base that may be missing; its shift hardly depends on it
_RIVAL_BIC = 20.0  # rise above which another model does not bear on f_d: odds of 1 to 20,000
PROMISE_MIN = 10.0
"""Fall of the BIC below which an effect is not tried: odds of 150 to 1 (Kass and Raftery: very strong)."""
_EVIDENCE_MIN = 10.0  # fall of the BIC below which it is not kept
_RISE_CERTAIN = 400.0  # of chi-square without an effect: 20 standard uncertainties, and no refit is needed
_CLEAR_SIGMAS = 3.0  # of a size that is not zero
_STEPS_TRIAL, _STEPS_WINDOW, _STEPS_LAST = 6, 10, 6
_EXPLAINED = 1.15  # chi-square a reading below which a window asks for no further effect
_EXPLAINED_SHARE_MIN = 0.2
"""Share of what is not explained by which an effect lowers the BIC at the least: one of four does, and an
effect that does less is not what is wrong with the record."""
_TAIL_PERIODS = 8.0  # of the stick tail in which effects are looked for
_FOLLOWED_BIC = 100.0  # above one and a half times the best: sets farther off are given up
_FOLLOWED = 3  # sets of effects that are followed from one window to the next
_STATIC_RATIOS = np.concatenate((np.linspace(1.01, 1.4, 14), np.geomspace(1.45, 4.3, 12)))
"""f_s over f_d; 4.3 on oiled steel in the paper's Table 1."""
_RAMP, _STEP, _VELOCITY, _FILTER = effects_by_name(
    ("release-ramp", "release-step", "release-velocity", "filter")
)
_TWO_STEPS = ((1.0, 0.85), (1.5, 0.6))
"""Length of a release over that of a slow one that passes for it, and share of the force lost at once."""
_NOTHING = QuadraticModel(0.0, np.empty(0), np.empty((0, 0)))
_PLACES = {place: PARAMETER_COUNT + place for place in StandParameter}
"""Places in a point of a `StandModel`."""
_HIGHEST_MODE = 30.0  # of second modes that are looked for, over the first frequency
_LINES = 3  # of the residual's spectrum that are tried as second modes
_FUNDAMENTAL = 0.2  # a second mode differs from the first by this share of its frequency at the least


@dataclass(frozen=True, eq=False, slots=True)
class StandFit:
    """A law with effects of the stand, fitted to a record."""

    fit: Fit
    problem: FitProblem
    evidence: dict[str, float]
    """Rise of the BIC without each of the effects that stands on its own, by name."""
    rivals: list[tuple[float, float]]
    """Rise of the BIC with other sets of effects, and shift of f_d, or of its mean over the slid path."""


@dataclass(frozen=True, eq=False, slots=True)
class MissingEffect:
    """An effect that a fit does without, as far as a motion that is linear about the fit tells."""

    effect: StandEffect
    fall: float  # of chi-square with it
    promise: float  # fall of the BIC
    friction_shift: float  # of f_d, or of its mean over the slid path

    @property
    def weight(self) -> float:
        """Odds of the effect: Akaike's weight (Burnham and Anderson, 2002) times `_PRIOR_ODDS`."""
        count = len(self.effect.own) + len(self.effect.shared)
        return _PRIOR_ODDS * float(np.exp(min(0.5 * self.fall - count, _LOG_WEIGHT_MAX)))


@dataclass(frozen=True, eq=False, slots=True)
class _LinearStep:
    """Minimum of a motion that is linear about a trial, with one effect more."""

    minimum: Floats
    fall: float  # of chi-square
    starts: list[Floats]  # to begin its fit from


@dataclass(frozen=True, eq=False, slots=True)
class _Trial:
    model: StandModel
    minimum: Minimum
    bic: float

    @property
    def point(self) -> Floats:
        return self.minimum.parameters

    @property
    def names(self) -> frozenset[str]:
        return frozenset(effect.name for effect in self.model.effects)


class StandSearch:
    """Fits of one friction law with effects of the stand to one record.

    Several sets of effects are followed at a time, since the first effect that explains most is not always
    one of those that explain all.
    """

    def __init__(
        self, search: Search, law: FrictionLaw, ideal: Fit, tail: DampedCosine | None = None
    ) -> None:
        self._law, self._period_s, self._slip_end_s = law, search.period_s, search.slip_end_s
        self._release_s = ideal.value(Parameter.RELEASE)
        self._noise_m = search.problem.noise_m
        self.problem = extended_problem(search.problem)
        self._searched = _with_known_masses(self.problem)
        self._informed = _with_wide_priors(_with_known_masses(extended_problem(search.informed_problem)))
        left, _ = search.problem.residuals(ideal.parameters, ideal.law)
        self._left_by_ideal = [Channel(search.problem.table.time_s, left)]
        if tail is not None:
            time_s = np.linspace(tail.start_s, tail.end_s, len(tail.residual_m))
            self._left_by_ideal.append(Channel(time_s, tail.residual_m))
        self._effort = 0.0  # steps of integration so far
        self._finished: tuple[_Trial, Fit] | None = None

    def missing_effects(self, fit: Fit, among: tuple[StandEffect, ...] = EFFECTS) -> list[MissingEffect]:
        """Effects that would lower the chi-square of a fit that leaves nothing but noise, each by itself.

        Tests of size and colour of the residual let smooth deviations through that this score test sees. None
        where the noise is as small as the errors of integration.
        """
        if min(self._noise_m) <= INTEGRATION_ERROR_M:
            return []
        window = self._whole().decimated(_READINGS_MISSING, self._slip_end_s)
        model = fit.law if isinstance(fit.law, StandModel) else compose(fit.law, ())
        point = fit.parameters if model is fit.law else extended_point(fit.parameters)
        minimum = Minimum(point, _NOTHING, 0, converged=True)
        trial = _Trial(model, minimum, 0.0)
        candidates = [
            effect
            for effect in self._candidates(trial)
            if effect in among and not effect.needs and effect is not STATIC_FRICTION
        ]
        frequencies_hz = {
            StandParameter.BASE_FREQUENCY: _BASE_HARMONIC / self._period_s,
            StandParameter.MODE_FREQUENCY: next(iter(self._lines(window, trial)), 0.0),
        }
        friction = self._friction(window, model, point)
        missing = []
        for name, step in self._linear_steps(window, trial, candidates, frequencies_hz).items():
            effect = next(effect for effect in candidates if effect.name == name)
            extended = compose(model.law, (*model.effects, effect))
            shift = self._friction(window, extended, step.minimum) - friction
            missing.append(MissingEffect(effect, step.fall, step.fall - self._price(window, effect), shift))
        return missing

    def _friction(self, window: FitProblem, model: StandModel, point: Floats) -> float:
        """f_d, or its mean over the slid path where it varies."""
        if not (model.law.own or any(effect.varies_friction for effect in model.effects)):
            return float(point[Parameter.FRICTION_DYNAMIC])
        duration_s = float(window.table.time_s[-1] - point[Parameter.RELEASE])
        return model.mean_friction(project_to_bounds(point, model), duration_s)

    def fit(self, starts: list[Floats], is_adequate: Callable[[Fit], bool]) -> StandFit:
        """Fit the law with the effects that the record shows, from points (p,) of an ideal stand."""
        points = [extended_point(start) for start in starts]
        first = self._window(_WINDOWS_PERIODS[0])
        trials = [min((self._trial(first, (), point) for point in points), key=_bic_of)]
        for periods in _WINDOWS_PERIODS:
            window = self._window(periods)
            trials = self._continue(window, trials)
            trials = self._extend_while(window, trials, _explains)
        window = self._whole().decimated(_READINGS_WHOLE, self._slip_end_s)
        followed = self._continue(window, trials)
        trials = self._extend_while(
            window,
            followed[:1],
            lambda window, best: _explains(window, best) and is_adequate(self._finish(best)),
        )
        return self._stand_fit(window, trials[0], [*trials, *followed])

    def extend(self, fit: Fit) -> StandFit:
        """Add effects to a fit on an ideal stand that leaves hardly more than noise."""
        window = self._whole().decimated(_READINGS_MISSING, self._slip_end_s)
        effects = (STATIC_FRICTION,) if fit.law.has_static_friction else ()
        first = self._trial(window, effects, extended_point(fit.parameters))
        trials = self._extend_while(window, [first], lambda _window, _best: False)
        return self._stand_fit(window, trials[0], trials)

    def _stand_fit(self, window: FitProblem, best: _Trial, others: list[_Trial]) -> StandFit:
        """The best trial without needless effects, fitted to all readings, and what the others say of f_d.

        `best` is one of the `others`, too.
        """
        alike = [*self._in_two_steps(window, best), *self._with_slow_release(window, best)]
        trial, evidence = self._without_needless(window, min((best, *alike), key=_bic_of))
        friction = self._friction(window, trial.model, trial.point)
        rivals = [
            (other.bic - trial.bic, self._friction(window, other.model, other.point) - friction)
            for other in (*others, *alike)
            if other.names != trial.names and other.bic < trial.bic + _RIVAL_BIC
        ]
        fit = self._finish(trial)
        return StandFit(fit, _open_shared(self.problem, fit.law), evidence, rivals)

    def _continue(self, window: FitProblem, trials: list[_Trial]) -> list[_Trial]:
        """Refit trials of a shorter window, also with an f_s, which matters only once a stick has ended."""
        found: list[_Trial] = []
        for trial in trials:
            if found and self._is_spent:
                break
            found.append(self._trial(window, trial.model.effects, trial.point))
            if self._is_spent:
                break
            if STATIC_FRICTION not in trial.model.effects and not _explains(window, found[-1]):
                effects = (*trial.model.effects, STATIC_FRICTION)
                starts = self._starts(window, STATIC_FRICTION, trial)
                found += [self._trial(window, effects, start) for start in starts]
        return _lowest(found)

    def _extend_while(
        self, window: FitProblem, trials: list[_Trial], is_enough: Callable[[FitProblem, _Trial], bool]
    ) -> list[_Trial]:
        """Add effects to the best of `trials` until the best is enough, or no lower BIC is found."""
        extended = set[frozenset[str]]()
        while not is_enough(window, trials[0]):
            best = trials[0]
            for trial in trials[:]:
                if self._is_spent:
                    return trials
                if trial.names not in extended and len(trial.model.effects) < _EFFECTS_MOST:
                    extended.add(trial.names)
                    trials += self._extensions(window, trial)
            trials = _lowest(trials)
            excess = best.minimum.cost - window.sample_count
            if trials[0].bic > best.bic - max(_EVIDENCE_MIN, _EXPLAINED_SHARE_MIN * excess):
                break
        return trials

    def _in_two_steps(self, window: FitProblem, trial: _Trial) -> list[_Trial]:
        """A trial of a slow release behind a filter, with a release in two steps in place of the filter.

        None of any other trial. Both round the start of the motion alike, so that a search that met the
        filter first ends there.
        """
        if not {_RAMP.name, _FILTER.name} <= trial.names:
            return []
        kept = [effect for effect in trial.model.effects if _FILTER.name not in (effect.name, effect.needs)]
        effects = (*kept, *(() if _STEP.name in trial.names else (_STEP,)))
        start = trial.point.copy()
        left_out = [effect for effect in trial.model.effects if effect not in kept]
        start[[_PLACES[place] for effect in left_out for place in effect.own]] = 0.0
        found = []
        for ramp, step in _TWO_STEPS:
            point = start.copy()
            point[_PLACES[StandParameter.RELEASE_RAMP]] *= ramp
            point[_PLACES[StandParameter.RELEASE_STEP]] = step
            found.append(self._trial(window, effects, point))
        return [min(found, key=_bic_of)]

    def _with_slow_release(self, window: FitProblem, trial: _Trial) -> list[_Trial]:
        """A trial of a table that moved at the release, with a slow release in its place.

        None of any other trial. Both shift the start of the motion alike, so that a search that met the
        velocity first ends there.
        """
        if _VELOCITY.name not in trial.names or _RAMP.name in trial.names:
            return []
        effects = tuple(_RAMP if effect is _VELOCITY else effect for effect in trial.model.effects)
        found = []
        for (ramp_s,) in _RAMP.probes:
            point = trial.point.copy()
            point[_PLACES[StandParameter.RELEASE_VELOCITY]] = 0.0
            point[_PLACES[StandParameter.RELEASE_RAMP]] = ramp_s
            point[Parameter.RELEASE] -= 0.5 * ramp_s
            found.append(self._trial(window, effects, point))
        return [min(found, key=_bic_of)]

    def _trial(
        self, window: FitProblem, effects: tuple[StandEffect, ...], point: Floats, steps: int = _STEPS_WINDOW
    ) -> _Trial:
        model = compose(self._law, effects)
        opened = _open_shared(window, model)
        minimum = opened.minimise(point, model, steps)
        motions = minimum.steps * (1 + motion_count(opened.free_parameters(model)))
        self._effort += motions * self._steps(window, minimum.parameters)
        parameter_count = len(opened.model_parameters(model))
        bic = minimum.cost + parameter_count * float(np.log(opened.sample_count))
        return _Trial(model, minimum, bic + sum(effect.rarity for effect in effects))

    def _extensions(self, window: FitProblem, trial: _Trial) -> list[_Trial]:
        """The trial with one effect more, of those that promise most."""
        found = []
        for effect, start in self._promising(window, trial, self._candidates(trial)):
            if self._is_spent:
                break
            better = self._trial(window, (*trial.model.effects, effect), start, _STEPS_TRIAL)
            if better.bic < trial.bic - _EVIDENCE_MIN:
                found.append(better)
        return found

    def _candidates(self, trial: _Trial) -> list[StandEffect]:
        """Effects that a model may take beside its own."""
        present = trial.names
        return [
            effect
            for effect in EFFECTS
            if effect.name not in present
            and (not effect.needs or effect.needs in present)
            and not set(effect.shared) & set(trial.model.law.extra)
        ]

    def _promising(
        self, window: FitProblem, trial: _Trial, candidates: list[StandEffect]
    ) -> list[tuple[StandEffect, Floats]]:
        """Effects that lower the BIC, the best first, with the point of each from which to fit."""
        ranked: list[tuple[float, StandEffect, Floats]] = []
        linear = [effect for effect in candidates if not set(effect.own) & set(_FREQUENCIES)]
        steps = self._linear_steps(window, trial, linear)
        for effect in candidates:
            if effect in linear:
                starts = steps[effect.name].starts + self._starts(window, effect, trial)
            else:
                place = next(place for place in effect.own if place in _FREQUENCIES)
                starts = [
                    start
                    for frequency_hz in self._frequencies(window, trial, effect)
                    for step in self._linear_steps(window, trial, [effect], {place: frequency_hz}).values()
                    for start in step.starts
                ]
            if starts:
                model = compose(self._law, (*trial.model.effects, effect))
                costs = [_open_shared(window, model).cost(start, model) for start in starts]
                self._effort += sum(self._steps(window, start) for start in starts)
                least = int(np.argmin(costs))
                ranked.append((costs[least] + self._price(window, effect), effect, starts[least]))
        ranked.sort(key=lambda one: one[0])
        best = [effect for _, effect, _ in ranked[:_TRIED]]
        promising = sorted(linear, key=lambda effect: self._price(window, effect) - steps[effect.name].fall)
        best += promising[:_TRIED_BY_PROMISE]
        return [(effect, start) for _, effect, start in ranked if effect in best]

    def _frequencies(self, window: FitProblem, trial: _Trial, effect: StandEffect) -> list[float]:
        """Frequencies (Hz) that the second oscillator of an effect may have."""
        if StandParameter.MODE_FREQUENCY not in effect.own:
            return [harmonic / self._period_s for harmonic in _BASE_HARMONICS]
        found = self._lines(window, trial)
        for channel in self._left_by_ideal:
            found += _strongest_frequencies(channel, self._release_s, self._period_s, 1)
        return list(dict.fromkeys(round(frequency_hz, 1) for frequency_hz in found))

    def _lines(self, window: FitProblem, trial: _Trial) -> list[float]:
        """Frequencies (Hz) of the strongest lines in what a trial leaves of gauge 1."""
        residual, _ = window.residuals(trial.point, trial.model)
        channel = Channel(window.table.time_s, residual)
        return _strongest_frequencies(channel, self._release_s, self._period_s, _LINES)

    def _price(self, window: FitProblem, effect: StandEffect) -> float:
        count = len(effect.own) + len(effect.shared)
        return count * float(np.log(window.sample_count)) + effect.rarity

    @property
    def _is_spent(self) -> bool:
        return self._effort > _EFFORT_MAX

    def _steps(self, window: FitProblem, point: Floats) -> float:
        """Effort of one motion in a window, in steps of its integration; reading it costs some too."""
        fastest_hz = max(float(point[_PLACES[place]]) for place in _FREQUENCIES)
        steps_per_s = max(_STEPS_A_PERIOD / self._period_s, _STEPS_A_CYCLE * fastest_hz)
        presliding_m = float(point[_PLACES[StandParameter.PRESLIDING]])
        if presliding_m > 0.0:
            square = point[Parameter.FRICTION_DYNAMIC] * point[Parameter.GRAVITY] / presliding_m
            steps_per_s += float(square) ** 0.5
        squares = [float(point[_PLACES[place]]) for place in _FILTERS if point[_PLACES[place]] > 0.0]
        if squares:
            steps_per_s += _STEPS_A_GRID_POINT / filter_step_s(min(squares) ** 0.5)
        duration_s = float(window.table.time_s[-1] - self._release_s)
        return duration_s * steps_per_s + _STEPS_A_READING * window.sample_count

    def _starts(self, window: FitProblem, effect: StandEffect, trial: _Trial) -> list[Floats]:
        """Points to begin the fit of one effect more from, where a linear step may lead elsewhere."""
        model, starts = compose(self._law, (*trial.model.effects, effect)), []
        for probe in effect.probes or [()] * (effect is STATIC_FRICTION):
            start = trial.point.copy()
            start[[_PLACES[place] for place in effect.own]] = probe
            if STATIC_FRICTION.name in (effect.name, effect.needs):
                points = np.tile(start, (len(_STATIC_RATIOS), 1))
                points[:, Parameter.FRICTION_STATIC] = _STATIC_RATIOS * start[Parameter.FRICTION_DYNAMIC]
                costs = [window.chi_square(one, model) for one in points]
                self._effort += len(points) * self._steps(window, start)
                start = points[int(np.argmin(costs))]
            starts.append(start)
        return starts

    def _without_needless(self, window: FitProblem, trial: _Trial) -> tuple[_Trial, dict[str, float]]:
        """The trial without the effects that the others make needless; rise of the BIC without each other."""
        evidence: dict[str, float] = {}
        for effect in trial.model.effects:
            if any(other.needs == effect.name for other in trial.model.effects):
                continue
            rise = self._linear_rise(window, trial, effect)
            if effect is not STATIC_FRICTION and rise > _RISE_CERTAIN:
                evidence[effect.name] = rise - self._price(window, effect)
                continue
            effects = tuple(other for other in trial.model.effects if other is not effect)
            point = trial.point.copy()
            point[[_PLACES[place] for place in effect.own]] = 0.0
            point[[place for place in effect.shared if place != Parameter.FRICTION_STATIC]] = 0.0
            without = self._trial(window, effects, point, _STEPS_LAST)
            if without.bic < trial.bic + _EVIDENCE_MIN:
                trial = without
            else:
                evidence[effect.name] = without.bic - trial.bic
        return trial, evidence

    def _linear_rise(self, window: FitProblem, trial: _Trial, effect: StandEffect) -> float:
        """Rise of chi-square without an effect of the trial, as a linear motion tells."""
        free = _open_shared(window, trial.model).free_parameters(trial.model)
        mine = np.isin(free, _sizes(effect))
        normal = trial.minimum.quadratic.normal
        inverse, _ = covariance(normal[np.ix_(~mine, ~mine)])
        cross = normal[np.ix_(mine, ~mine)]
        size = trial.point[free[mine]]
        return float(size @ (normal[np.ix_(mine, mine)] - cross @ inverse @ cross.T) @ size)

    def _linear_steps(
        self,
        window: FitProblem,
        trial: _Trial,
        candidates: list[StandEffect],
        frequencies_hz: dict[StandParameter, float] | None = None,
    ) -> dict[str, _LinearStep]:
        """Step of a linear motion with each of the effects, by its name; within its bounds.

        What is stated of lag and gain of gauge 2 holds for all effects but those that free them.
        """
        point = trial.point.copy()
        own_places = {place for effect in candidates for place in effect.own}
        for place in own_places.intersection(_FREQUENCIES):
            point[_PLACES[place]] = (frequencies_hz or {})[place]
        for place, first in _SECOND_ORDER.items():
            if place in own_places:
                point[_PLACES[place]] = first
        law, effects = trial.model.law, trial.model.effects
        model = compose(law, (*effects, *candidates))
        free = window.free_parameters(model)
        base = set(window.free_parameters(trial.model).tolist())
        fixed = [_PLACES[place] for place in (*_FREQUENCIES, *_SECOND_ORDER) if place in own_places]
        free = free[~np.isin(free, fixed)]
        quadratic = GaussNewton(window, model, free).evaluate(point)
        self._effort += (1 + motion_count(free)) * self._steps(window, point)
        present = np.array([place in base for place in free.tolist()])
        away, stated = window.prior_mean[free] - point[free], window.prior_weights(free)
        steps: dict[str, _LinearStep] = {}
        for effect in candidates:
            mine = np.isin(free, [*(_PLACES[place] for place in effect.own), *effect.shared])
            own, freed = present & ~mine, stated[mine]
            inverse, _ = covariance(quadratic.normal[np.ix_(own, own)])
            cross = quadratic.normal[np.ix_(mine, own)]
            left = quadratic.normal[np.ix_(mine, mine)] - np.diag(freed) - cross @ inverse @ cross.T
            pull = quadratic.descent[mine] - freed * away[mine] - cross @ inverse @ quadratic.descent[own]
            amount = np.linalg.pinv(left, rcond=1e-9, hermitian=True) @ pull
            extended = compose(law, (*effects, effect))
            opened = _open_shared(window, extended)
            reached = []
            for share in _STEP_SHARES:
                moved = point.copy()
                moved[free[mine]] += share * amount
                extended.apply_bounds(moved)
                taken = moved[free[mine]] - point[free[mine]]
                moved[free[own]] += inverse @ (quadratic.descent[own] - cross.T @ taken)
                gain = 2.0 * pull @ taken - taken @ left @ taken + freed @ away[mine] ** 2
                reached.append((moved, float(gain)))
            minimum, fall = reached[0]
            starts = []
            if fall - self._price(window, effect) > PROMISE_MIN:
                starts = [opened.project(moved, extended, free) for moved, _ in reached]
            starts = [start for start in starts if start[list(_MASSES)].min() > 0.0]
            steps[effect.name] = _LinearStep(minimum, fall, starts)
        return steps

    def _finish(self, trial: _Trial) -> Fit:
        """The trial fitted to all readings."""
        if self._finished is not None and self._finished[0] is trial:
            return self._finished[1]
        problem = _open_shared(self.problem, trial.model)
        last = problem.minimise(trial.point, trial.model, _STEPS_LAST)
        fit = fit_at_minimum(problem, trial.model, last)
        self._finished = trial, fit
        return fit

    def _whole(self) -> FitProblem:
        """The record without most of its tail."""
        return self._searched.before(self._slip_end_s + _TAIL_PERIODS * self._period_s)

    def _window(self, periods: float) -> FitProblem:
        end_s = self._release_s + periods * self._period_s
        return self._informed.before(end_s).decimated(_READINGS, np.inf)


def friction_spread(missing: list[MissingEffect], rivals: Iterable[tuple[float, float]] = ()) -> float:
    """Standard deviation of f_d between a model and others that the record leaves possible.

    `rivals` are others as in `StandFit`.
    """
    others = [(each.weight, each.friction_shift) for each in missing]
    others += [(float(np.exp(-0.5 * max(rise, 0.0))), shift) for rise, shift in rivals]
    total = 1.0 + sum(weight for weight, _ in others)
    return float(np.sqrt(sum(weight * shift**2 for weight, shift in others) / total))


def is_clear(fit: Fit, effect: StandEffect) -> bool:
    """Whether a size of the effect is not zero: without it a search may only end at a jump of f_s."""
    spread, _ = covariance(fit.normal_matrix)
    mine = np.isin(fit.free, _sizes(effect))
    return bool(
        (np.abs(fit.parameters[fit.free[mine]]) > _CLEAR_SIGMAS * np.sqrt(np.diag(spread)[mine])).any()
    )


def _sizes(effect: StandEffect) -> list[int]:
    """Places of the parameters that are zero without the effect."""
    own = [_PLACES[place] for place in effect.own if place not in (*_FREQUENCIES, *_SECOND_ORDER)]
    return [*own, *effect.shared]


def extended_problem(problem: FitProblem) -> FitProblem:
    """The problem with the parameters of the stand, of which nothing is known.

    Its noise is at least the error of integrated motions.
    """
    return replace(
        problem,
        noise_m=(max(problem.noise_m[0], INTEGRATION_ERROR_M), max(problem.noise_m[1], INTEGRATION_ERROR_M)),
        prior_mean=extended_point(problem.prior_mean),
        prior_deviation=np.concatenate((problem.prior_deviation, np.full(STAND_PARAMETER_COUNT, np.inf))),
    )


def stand_problem(problem: FitProblem, model: StandModel) -> FitProblem:
    """The problem as a fit of this model solves it."""
    return _open_shared(extended_problem(problem), model)


def _open_shared(problem: FitProblem, model: FrictionLaw) -> FitProblem:
    """The problem without what is stated of lag and gain of gauge 2, where the model frees them."""
    for place in (Parameter.LAG, Parameter.RELATIVE_GAIN):
        if place in model.extra:
            problem = problem.with_prior(place, 0.0, np.inf)
    return problem


def _with_known_masses(problem: FitProblem) -> FitProblem:
    """The problem with masses as stated: their uncertainties move no effect, and cost a motion each."""
    for place in _MASSES:
        problem = problem.with_prior(place, float(problem.prior_mean[place]), 0.0)
    return problem


def _with_wide_priors(problem: FitProblem) -> FitProblem:
    """First estimates guide the first periods only roughly, as they hold for an ideal stand."""
    mean = problem.prior_mean
    for place, share, least in _WIDE_PRIORS:
        if np.isfinite(problem.prior_deviation[place]):
            problem = problem.with_prior(place, float(mean[place]), share * abs(float(mean[place])) + least)
    return problem


_WIDE_PRIORS = (
    (Parameter.FRICTION_DYNAMIC, 0.3, 0.0),
    (Parameter.TILT, 0.0, 0.01),
    (Parameter.STIFFNESS, 0.03, 0.0),
    (Parameter.DAMPING, 3.0, 10.0),
    (Parameter.TABLE_OFFSET, 0.0, 2e-4),
)
"""Standard deviation as a share of the value, and at the least (rad, kg/s, m)."""


def _lowest(trials: list[_Trial]) -> list[_Trial]:
    """The few sets of effects of lowest BIC, the best of each, without those far from the best of all."""
    found: dict[frozenset[str], _Trial] = {}
    for trial in sorted(trials, key=_bic_of):
        found.setdefault(trial.names, trial)
    best, *others = (
        trial
        for trial in found.values()
        if not any(less.names < trial.names and less.bic <= trial.bic for less in found.values())
    )
    return [best, *(trial for trial in others if trial.bic < best.bic + best.minimum.cost + _FOLLOWED_BIC)][
        :_FOLLOWED
    ]


def _explains(window: FitProblem, trial: _Trial) -> bool:
    return trial.minimum.cost < _EXPLAINED * window.sample_count


def _bic_of(trial: _Trial) -> float:
    return trial.bic


def _strongest_frequencies(channel: Channel, release_s: float, period_s: float, count: int) -> list[float]:
    """Frequencies (Hz) of the strongest few lines of a spectrum above the fundamental."""
    after = channel.between(release_s, np.inf)
    length = len(after)
    time_s, step_s = np.linspace(after.time_s[0], after.time_s[-1], length, retstep=True)
    value_m = np.interp(time_s, after.time_s, after.value_m)
    frequencies = np.fft.rfftfreq(4 * length, step_s)
    power = np.abs(np.fft.rfft((value_m - value_m.mean()) * np.hanning(2 * length)[length:], 4 * length))
    inner = frequencies[1:-1]
    is_line = (power[1:-1] > power[:-2]) & (power[1:-1] >= power[2:])
    is_line &= (inner * period_s > 1.0 + _FUNDAMENTAL) & (inner * period_s < _HIGHEST_MODE)
    lines, sizes = inner[is_line], power[1:-1][is_line]
    likeliest = np.argsort(-sizes * np.sqrt(lines))  # what is left of slips falls with frequency
    return [float(lines[index]) for index in likeliest[:count]]
