"""What the engine says, and what it changes on Record: where the test stands, the header, the traces."""

from pathlib import Path

from app.acquisition.messages import (
    Connected,
    Event,
    Health,
    LiveResult,
    PullbackState,
    Reconnected,
    Reconnecting,
    RunEnded,
    RunStarted,
    StateChanged,
)
from app.acquisition.pullback.plan import AllowedPlateRange
from app.presenters.base import Chip, Tone
from app.presenters.record.ended_run import EndedRun
from app.presenters.record.guidance import GuidanceInput
from app.presenters.record.live_display import LiveDisplay
from app.presenters.record.live_estimate import live_estimate
from app.presenters.record.live_traces import LiveTraces
from app.presenters.record.pullback_session import RECORDING, PullbackSession
from app.presenters.record.stand_context import StandContext
from app.presenters.record.status_bar import StatusBarPresenter
from app.presenters.results import sentence


class EngineEventReducer:
    """Hands each event to whom it concerns.

    Parameters
    ----------
    course : Course
    heading : Heading
    display : LiveDisplay
    ended_run : EndedRun
    """

    def __init__(
        self, course: PullbackSession, heading: StatusBarPresenter, display: LiveDisplay, ended_run: EndedRun
    ) -> None:
        self._course = course
        self._heading = heading
        self._display = display
        self._ended_run = ended_run

    def start_over(self, engine: PullbackState | None, device: str, pullback_m: float) -> None:
        """Another engine speaks from now on, or none; the result of the last run stays in sight."""
        self._course.connect(engine)
        self._display.start_over()
        self._heading.start(device)
        if self._course.after_run is None:
            self._ended_run.clear()
            self._display.clear(pullback_m)

    def on_event(self, event: Event) -> None:
        """Take one event."""
        self._heading.on_event()
        match event:
            case StateChanged():
                self._came_to(event)
            case Connected():
                self._heading.on_connected(event.device, event.rate_hz)
            case Reconnecting():
                self._lose(sentence(event.message))
            case Reconnected():
                self._lose("")
            case Health():
                self._heading.on_health(event)
            case LiveResult():
                self._course.live_estimate = live_estimate(event)
            case RunStarted():
                self._course.name = Path(event.path).stem
            case RunEnded():
                self._ended_run.end(event)

    def _came_to(self, event: StateChanged) -> None:
        if event.state in RECORDING:
            self._ended_run.close()
        self._display.live.on_state_changed(event.state, event.since_s, event.position)
        self._course.on_state_changed(event)

    def _lose(self, why: str) -> None:
        self._course.loss_reason = why
        self._heading.on_device_lost(why)


def guidance_input(
    course: PullbackSession, bench: StandContext, live: LiveTraces, series: str
) -> GuidanceInput:
    """Put together where the test stands; `series` is that of the next run."""
    gauge = bench.gauges.relative
    table_m, relative_m = (float(value) for value in live.newest_m() + live.zero_m)
    return GuidanceInput(
        stage=course.stage,
        standing=course.standing,
        table_m=table_m,
        plate_m=relative_m + table_m if gauge.measures == "plate" else relative_m,
        plate_range=bench.allowed_plate_range(series),
        simulated=course.simulated,
        note="" if course.is_idle else course.note,
        waiting_for=course.waiting_for,
        loss_reason=course.loss_reason,
    )


def status_message(course: PullbackSession, said: Chip) -> Chip:
    """Add to what was `said` what the engine notes while nothing is recorded: it is no instruction then."""
    if not (course.is_idle and course.note):
        return said
    tone = Tone.BAD if said.tone is Tone.BAD else Tone.WARN
    parts = (said.text.rstrip("."), sentence(course.note))
    return Chip(". ".join(filter(None, parts)), tone, said.hint)


def shown_plate_range(course: PullbackSession, bench: StandContext, series: str) -> AllowedPlateRange | None:
    """Where the plate may stand, while it has to be put back and gauge 2 can show where."""
    measures_it = bench.gauges.relative.measures == "relative"
    has_to = course.engine is PullbackState.RECENTRE
    return bench.allowed_plate_range(series) if measures_it and has_to else None
