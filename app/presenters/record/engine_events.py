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
from app.presenters.record.course import RECORDING, Course
from app.presenters.record.ended_run import EndedRun
from app.presenters.record.heading import Heading
from app.presenters.record.live_display import LiveDisplay
from app.presenters.record.running import running_of
from app.presenters.results import sentence


class EngineEvents:
    """Hands each event to whom it concerns.

    Parameters
    ----------
    course : Course
    heading : Heading
    display : LiveDisplay
    ended_run : EndedRun
    """

    def __init__(self, course: Course, heading: Heading, display: LiveDisplay, ended_run: EndedRun) -> None:
        self._course = course
        self._heading = heading
        self._display = display
        self._ended_run = ended_run

    def start_over(self, engine: PullbackState | None, device: str, pullback_m: float) -> None:
        """Another engine speaks from now on, or none; the result of the last run stays in sight."""
        self._course.connect(engine)
        self._display.start_over()
        self._heading.start(device)
        if self._course.after is None:
            self._ended_run.forget()
            self._display.clear(pullback_m)

    def take(self, event: Event) -> None:
        """Take one event."""
        self._heading.hear()
        match event:
            case StateChanged():
                self._came_to(event)
            case Connected():
                self._heading.connected(event.device, event.rate_hz)
            case Reconnecting():
                self._lose(sentence(event.message))
            case Reconnected():
                self._lose("")
            case Health():
                self._heading.health(event)
            case LiveResult():
                self._course.running = running_of(event)
            case RunStarted():
                self._course.name = Path(event.path).stem
            case RunEnded():
                self._ended_run.end(event)

    def _came_to(self, event: StateChanged) -> None:
        if event.state in RECORDING:
            self._ended_run.leave()
        self._display.live.mark(event.state, event.since_s, event.position)
        self._course.come_to(event)

    def _lose(self, why: str) -> None:
        self._course.lost = why
        self._heading.lose(why)
