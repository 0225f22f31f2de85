"""What the Identify screen does: an analysed run in, curves and rows out."""

import math
from collections.abc import Callable
from pathlib import Path

from analysis.identification import ModelVerdict
from app.presenters import numbers, results
from app.presenters.analysed import AnalysedRun, Channel
from app.presenters.identify.state import ChannelCurves, Curves, IdentifyState, ModelRow
from app.presenters.screen import Presenter, Progress


class IdentifyPresenter(Presenter[IdentifyState]):
    """Shows one run.

    Parameters
    ----------
    cancel : callable
        Gives up the analysis that is going on.
    """

    def __init__(self, cancel: Callable[[], None]) -> None:
        super().__init__(IdentifyState())
        self._cancel = cancel
        self._path = ""

    def cancel(self) -> None:
        """Give up the analysis that is going on."""
        if self.state.progress is not None:
            self._cancel()

    def opening(self, path: str) -> None:
        """A run is being read and identified; what was shown before goes."""
        self._path = path
        self.state = IdentifyState()
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
            progress=None,
            failure="",
        )


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
