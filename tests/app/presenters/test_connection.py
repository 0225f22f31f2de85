"""One connection at a time, opened in the background, and nothing left running."""

import threading
from collections.abc import Iterator

import pytest
from stage import FakeEngine, FakeLauncher, FakeSimulation, ended

from app.acquisition.messages import (
    Arm,
    Connected,
    Event,
    Failed,
    PortSettings,
    PullbackState,
    RunEnded,
    RunSettings,
    StateChanged,
    Stop,
)
from app.acquisition.ring import RingRows
from app.presenters.base import SimulationStarted
from app.presenters.connection import Connection
from app.presenters.error_reports import ErrorReporter
from app.simulated_stand.options import Gesture, SimulatedStandOptions
from config.files import published_row
from drivers.errors import PortUnavailableError
from tests.waiting import PATIENCE_S, wait_until

PORT = PortSettings("COM7", "csv")


@pytest.fixture
def launcher() -> FakeLauncher:
    return FakeLauncher()


@pytest.fixture
def faults() -> ErrorReporter:
    return ErrorReporter()


@pytest.fixture
def session(launcher: FakeLauncher, faults: ErrorReporter) -> Iterator[Connection]:
    made = Connection(*launcher.starters, faults.report)
    yield made
    made.close()
    assert faults.next_report() is None


def poll_until(session: Connection, kind: type) -> list[Event | SimulationStarted]:
    """Events until one of a kind has come."""
    events: list[Event | SimulationStarted] = []

    def has_come() -> bool:
        events.extend(session.poll())
        return any(isinstance(event, kind) for event in events)

    wait_until(has_come, lambda: events)
    return events


def test_a_stand_that_has_ended_is_not_offered(session: Connection, launcher: FakeLauncher) -> None:
    session.open_simulated(SimulatedStandOptions())
    poll_until(session, Connected)
    (stand,) = launcher.simulations
    assert session.stand is stand
    stand.is_running = False
    assert session.stand is None
    session.disconnect()
    wait_until(lambda: stand.stopped)


def test_nothing_happens_before_something_is_opened(session: Connection) -> None:
    assert session.poll() == []
    assert session.new_rows() is None
    session.send(Arm(RunSettings("/recordings")))
    session.send(Stop())
    assert not session.is_active


def test_a_port_is_opened_and_takes_commands(session: Connection, launcher: FakeLauncher) -> None:
    session.open_port(PORT)
    assert session.is_active
    poll_until(session, Connected)
    session.send(Arm(RunSettings("/recordings", series="1FFM0"), 3))
    session.send(Stop())
    assert launcher.ports == [PORT]
    assert launcher.engines[0].commands == [Arm(RunSettings("/recordings", series="1FFM0"), 3), Stop()]


def test_the_simulated_stand_is_started_first_and_ended_last(
    session: Connection, launcher: FakeLauncher
) -> None:
    session.open_simulated(SimulatedStandOptions(series="2SSM1"))
    events = poll_until(session, Connected)
    assert events[0] == SimulationStarted("2SSM1", published_row("2SSM1").friction_dynamic)
    session.disconnect()
    wait_until(lambda: launcher.simulations[0].stopped)
    assert launcher.engines[0].closed


def test_an_error_of_opening_is_an_event() -> None:
    launcher = FakeLauncher(error=PortUnavailableError("COM7 is busy.\nClose the other program"))
    failing = Connection(*launcher.starters, ErrorReporter().report)
    failing.open_port(PORT)
    (event,) = poll_until(failing, Failed)
    assert str(event.message) == "COM7 is busy. Close the other program"
    assert not failing.is_active
    failing.close()


def test_a_stand_whose_engine_does_not_start_is_ended(launcher: FakeLauncher) -> None:
    failing = FakeLauncher(error=PortUnavailableError("no"))
    session = Connection(*failing.starters, ErrorReporter().report)
    session.open_simulated(SimulatedStandOptions(series="1FFM0"))
    poll_until(session, Failed)
    session.close()
    assert failing.simulations[0].stopped


def test_an_engine_that_fails_is_let_go(session: Connection, launcher: FakeLauncher) -> None:
    session.open_simulated(SimulatedStandOptions(series="1FFM0"))
    poll_until(session, Connected)
    launcher.engines[0].say(Failed("COM7 is gone. Plug it in again"))
    poll_until(session, Failed)
    assert not session.is_active
    wait_until(lambda: launcher.simulations[0].stopped and launcher.engines[0].closed)


def test_opening_anew_ends_the_old_connection_first(session: Connection, launcher: FakeLauncher) -> None:
    session.open_port(PORT)
    poll_until(session, Connected)
    session.open_port(PORT)
    poll_until(session, Connected)
    assert [engine.closed for engine in launcher.engines] == [True, False]


def test_closing_waits_for_what_is_still_being_opened() -> None:
    class SlowLauncher(FakeLauncher):
        started = threading.Event()
        go_on = threading.Event()

        def simulation(self, options: SimulatedStandOptions) -> FakeSimulation:
            self.started.set()
            self.go_on.wait(PATIENCE_S)
            return super().simulation(options)

        def engine(self, port: PortSettings) -> FakeEngine:
            return super().engine(port)

    launcher = SlowLauncher()
    session = Connection(*launcher.starters, ErrorReporter().report)
    session.open_simulated(SimulatedStandOptions(series="1FFM0"))
    launcher.started.wait(PATIENCE_S)
    threading.Timer(0.05, launcher.go_on.set).start()
    session.close()
    assert launcher.engines[0].closed
    assert launcher.simulations[0].stopped


def test_closing_ends_everything_and_leaves_no_thread(launcher: FakeLauncher) -> None:
    before = threading.active_count()
    session = Connection(*launcher.starters, ErrorReporter().report)
    session.open_simulated(SimulatedStandOptions(series="1FFM0"))
    poll_until(session, Connected)
    session.close()
    assert launcher.engines[0].closed
    assert threading.active_count() == before


def test_whoever_listens_sees_the_samples_that_are_drawn(session: Connection, launcher: FakeLauncher) -> None:
    heard: list[RingRows] = []
    session.add_row_listener(heard.append)
    session.open_port(PORT)
    poll_until(session, Connected)
    launcher.engines[0].play(0.5)
    rows = session.new_rows()
    assert rows is not None
    assert heard == [rows]
    assert session.new_rows() is None
    assert len(heard) == 1


def test_the_stand_that_is_connected_can_be_disturbed(session: Connection, launcher: FakeLauncher) -> None:
    assert session.stand is None
    session.open_simulated(SimulatedStandOptions(series="2SSM1"))
    poll_until(session, Connected)
    assert session.stand is launcher.simulations[0]
    session.disconnect()
    assert session.stand is None


class BadEnds(FakeLauncher):
    """Whose engine and stand cannot be ended."""

    def engine(self, port: PortSettings) -> FakeEngine:
        made = super().engine(port)
        made.close = lambda: self.fail("COM7 cannot be closed. pull the plug")  # type: ignore[method-assign]
        return made

    def simulation(self, options: SimulatedStandOptions) -> FakeSimulation:
        made = super().simulation(options)
        made.stop = lambda: self.fail("the stand runs on")  # type: ignore[method-assign]
        return made

    def fail(self, words: str) -> None:
        raise PortUnavailableError(words)


def said(faults: ErrorReporter) -> list[str]:
    words = []
    while (fault := faults.next_report()) is not None:
        words.append(str(fault.message))
    return words


@pytest.mark.parametrize("opened", [True, False], ids=["connected", "still connecting"])
def test_what_goes_wrong_while_something_is_ended_is_told(opened: bool, faults: ErrorReporter) -> None:
    session = Connection(*BadEnds().starters, faults.report)
    session.open_simulated(SimulatedStandOptions(series="1FFM0"))
    if opened:
        poll_until(session, Connected)
    session.disconnect()
    session.close()
    assert said(faults) == ["COM7 cannot be closed. pull the plug", "the stand runs on"]


def test_an_engine_that_never_ends_keeps_nobody_waiting_for_ever(faults: ErrorReporter) -> None:
    class Hangs(FakeLauncher):
        go_on = threading.Event()

        def engine(self, port: PortSettings) -> FakeEngine:
            made = super().engine(port)
            made.close = lambda: self.go_on.wait(PATIENCE_S)  # type: ignore[method-assign]
            return made

    session = Connection(*Hangs().starters, faults.report)
    session.CLOSE_S = 0.05
    session.open_port(PORT)
    poll_until(session, Connected)
    session.close()
    (words,) = said(faults)
    assert words.startswith("Engine or simulated stand did not end within 0.05 s")
    (thread,) = [
        one for one in threading.enumerate() if one.name == "slipstand-connection" and one.is_alive()
    ]
    assert thread.daemon, "it would keep the program from ending"
    Hangs.go_on.set()
    thread.join(PATIENCE_S)


def test_the_simulated_stand_pulls_once_for_each_run(session: Connection, launcher: FakeLauncher) -> None:
    session.open_simulated(SimulatedStandOptions(on_demand=True))
    poll_until(session, Connected)
    (stand,), (engine,) = launcher.simulations, launcher.engines
    assert stand.asked == []
    states = (PullbackState.ZERO, PullbackState.PULLING, PullbackState.ZERO, PullbackState.TAIL)
    for number in (1, 2):  # the second run arms itself
        for state in states:
            engine.say(StateChanged(state, 0.0))
        engine.say(ended())
        poll_until(session, RunEnded)
        assert stand.asked == [Gesture.PULL] * number
