"""What the Identify screen does: an analysed run in, curves and rows out."""

import math
from collections.abc import Callable
from pathlib import Path

from analysis.identification import ModelVerdict
from app.presenters import numbers, results
from app.presenters.analysed import AnalysedRun, Channel, Objective
from app.presenters.analysis_task import Hand, WithFriction
from app.presenters.identify.state import (
    BudgetRow,
    ChannelCurves,
    Curves,
    Floats,
    HandSet,
    IdentifyState,
    ModelRow,
    Motion,
    Scan,
    Side,
)
from app.presenters.screen import Presenter, Progress


class IdentifyPresenter(Presenter[IdentifyState]):
    """Shows one run.

    Parameters
    ----------
    cancel : callable
        Gives up the analysis that is going on.
    simulate : callable
        Has a motion simulated elsewhere; the answer comes to `show_hand`.
    """

    def __init__(self, cancel: Callable[[], None], simulate: Callable[[WithFriction], None]) -> None:
        super().__init__(IdentifyState())
        self._cancel = cancel
        self._simulate = simulate
        self._path = ""
        self._objective: Objective | None = None
        self._awaited: WithFriction | None = None
        self._next: WithFriction | None = None

    def cancel(self) -> None:
        """Give up the analysis that is going on."""
        if self.state.progress is not None:
            self._cancel()

    def opening(self, path: str) -> None:
        """A run is being read and identified; what was shown before goes."""
        self._path = path
        self._objective = self._awaited = self._next = None
        self.state = IdentifyState(side=self.state.side)
        self._change(title=Path(path).name, progress=Progress("Reading the run"))

    def working(self, path: str, progress: Progress) -> None:
        """The identification goes on."""
        if path == self._path and self.state.progress is not None:
            self._change(progress=progress)

    def show_failure(self, path: str, message: str) -> None:
        """The run could not be read or identified."""
        if path == self._path:
            self._change(progress=None, failure=message)

    def show_run(self, run: AnalysedRun, true_friction: float | None = None) -> None:
        """Show an analysed run, unless another is awaited."""
        if str(run.path) != self._path:
            return
        self._change(
            title=run.path.name,
            curves=_curves(run),
            result=results.describe(run, true_friction),
            rows=results.all_rows(run),
            models=_models(run.model),
            budget=_budget(run),
            side=self.state.side if run.kinematics is not None else Side.DISPLACEMENT,
            motion=_motion(run),
            scan=_scan(run.objective),
            progress=None,
            failure="",
        )
        self._objective = run.objective

    def show_side(self, side: Side) -> None:
        """Show displacements, velocities, accelerations or the phase plane."""
        self._change(side=side)

    def set_friction(self, friction: float) -> None:
        """The handle was drawn to this f_d: simulate it, the newest one alone where several wait."""
        scan = self.state.scan
        if scan is None:
            return
        friction = min(max(friction, float(scan.friction[0])), float(scan.friction[-1]))
        asked = WithFriction(self._path, friction)
        if self._awaited is None:
            self._awaited = asked
            self._simulate(asked)
        else:
            self._next = asked

    def fit_again(self) -> None:
        """Take the handle back to the fitted f_d."""
        self._next = None
        self._change(hand=None)

    def show_hand(self, asked: WithFriction, hand: Hand | None) -> None:
        """Show a simulation that was asked for; None where it failed."""
        if asked != self._awaited:
            return
        self._awaited = None
        if hand is not None and self.state.curves is not None and self._objective is not None:
            self._change(hand=_hand(hand, self.state.curves, self._objective))
        following, self._next = self._next, None
        if following is not None:
            self.set_friction(following.friction)


def _curves(run: AnalysedRun) -> Curves:
    release_s = run.events.release_s
    origin_s = float(run.time_s[0]) if release_s is None else release_s
    return Curves(
        time_s=run.time_s - origin_s,
        time_title="time in the record, s" if release_s is None else "time from release, s",
        table=_channel(run.table),
        relative=None if run.relative is None else _channel(run.relative),
        slip=_slip(run, origin_s),
        noise_um=None if run.model is None else run.model.noise_rms_m * 1e6,
    )


def _channel(channel: Channel) -> ChannelCurves:
    if channel.fit_m is None or channel.residual_m is None:
        return ChannelCurves(channel.record_m * 1e3)
    return ChannelCurves(channel.record_m * 1e3, channel.fit_m * 1e3, channel.residual_m * 1e6)


def _slip(run: AnalysedRun, origin_s: float) -> tuple[float, float] | None:
    """From release to slip end; to the end of the record where it slides on; none where nothing slips."""
    if run.events.release_s is None or results.FRICTION.key not in run.results:
        return None
    end_s = float(run.time_s[-1]) if run.events.slip_end_s is None else run.events.slip_end_s
    return run.events.release_s - origin_s, end_s - origin_s


def _models(model: ModelVerdict | None) -> tuple[ModelRow, ...]:
    if model is None:
        return ()
    best = min((tried.bic for tried in model.tried), default=0.0)
    return tuple(
        ModelRow(
            name=tried.name,
            friction=numbers.rounded(tried.friction_dynamic, 5),
            residual=results.micrometres(tried.residual_rms_m),
            bic=_bic(tried.bic - best),
            chosen=tried.name == model.name,
        )
        for tried in sorted(model.tried, key=lambda tried: tried.bic)
    )


def _bic(above_best: float) -> str:
    """How much worse than the likeliest, as `best` or `+12`; a dash where that could not be said."""
    if not math.isfinite(above_best):
        return "–"
    return (
        "best" if above_best <= 0.0 else f"+{above_best:.1f}" if above_best < 10.0 else f"+{above_best:.0f}"
    )


def _motion(run: AnalysedRun) -> Motion | None:
    found = run.kinematics
    if found is None:
        return None
    return Motion(
        time_s=found.time_s - (run.events.release_s or float(run.time_s[0])),
        table_mm=found.table_m * 1e3,
        relative_mm=found.relative_m * 1e3,
        table_mm_per_s=found.table_m_per_s * 1e3,
        plate_mm_per_s=found.plate_m_per_s * 1e3,
        relative_mm_per_s=(found.plate_m_per_s - found.table_m_per_s) * 1e3,
        table_m_per_s2=found.table_m_per_s2,
        plate_m_per_s2=found.plate_m_per_s2,
        relative_m_per_s2=found.plate_m_per_s2 - found.table_m_per_s2,
    )


def _scan(objective: Objective | None) -> Scan | None:
    if objective is None:
        return None
    return Scan(objective.friction, objective.residual_m * 1e6, objective.fitted, objective.interval_95)


def _hand(hand: Hand, curves: Curves, objective: Objective) -> HandSet:
    residual_m = objective.residual_at(hand.friction)
    off_percent = 100.0 * (hand.friction / objective.fitted - 1.0)
    words = (
        f"By hand: {numbers.rounded(hand.friction, 5)}, "
        f"{numbers.with_unit(numbers.signed(f'{off_percent:+.2f}'), '%')} from the fit; "
        f"residual {results.micrometres(residual_m)}"
    )
    relative = None
    if curves.relative is not None and hand.relative_m is not None:
        relative = _simulated(curves.relative, hand.relative_m)
    return HandSet(hand.friction, residual_m * 1e6, words, _simulated(curves.table, hand.table_m), relative)


def _simulated(channel: ChannelCurves, simulation_m: Floats) -> ChannelCurves:
    simulation_mm = simulation_m * 1e3
    return ChannelCurves(channel.record_mm, simulation_mm, (channel.record_mm - simulation_mm) * 1e3)


def _budget(run: AnalysedRun) -> tuple[BudgetRow, ...]:
    """Sources of the uncertainty of f_d, largest first; those that are not stated come last."""
    lines = [line for line in run.budget if line.contribution_to == results.FRICTION.key]
    stated = [line for line in lines if math.isfinite(line.standard_uncertainty)]
    stated.sort(key=lambda line: -line.standard_uncertainty)
    largest = max((line.standard_uncertainty for line in stated), default=0.0)
    rows = [
        BudgetRow(line.source, f"{line.standard_uncertainty:.1e}", line.standard_uncertainty / largest)
        for line in stated
        if line.standard_uncertainty > 0.0
    ]
    return (*rows, *(BudgetRow(line.source, "not stated", 0.0) for line in lines if line not in stated))
