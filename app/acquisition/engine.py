"""The acquisition engine, which runs in a process of its own: see `EngineClient`.

Commands come in on stdin and events go out on stdout, one JSON document per line (`messages.py`). When stdin
ends, the owner is gone: a run that needs nobody goes on to its end, any other is ended. Either way it is
stored, and the process ends.
"""

import datetime
import logging
import math
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path

from msgspec.structs import replace

from app.acquisition import messages, run_setup
from app.acquisition.arming import Arming
from app.acquisition.disk_space import DiskDemand, DiskSpaceMonitor, check_disk_space
from app.acquisition.errors import AcquisitionError, DiskSpaceError, JournalError, StreamEndedError
from app.acquisition.journal.journal import Journal
from app.acquisition.live_client import LiveIdentifier
from app.acquisition.pullback.plan import ObservedSlip
from app.acquisition.recording import Latency, Recording, RecordingContext
from app.acquisition.ring import RingWriter, create_ring, live_folder, ring_capacity
from app.acquisition.run_file import end_reason
from app.acquisition.sleep_prevention import SleepPrevention
from app.acquisition.stream import live_stream
from app.child_process import CommandReader, EventSender, LineDecoder, ignore_session_signals, reserve_stdout
from app.log import start_log
from app.runs.errors import RunError
from app.runs.unattended import UnattendedRun, leave_note
from app.runs.writer_client import WriterClient
from config.files import load_gauges, load_stand
from config.schema import ConfigError, Gauges, Stand
from drivers.errors import DriverError
from drivers.simulated.identity import is_simulated_device
from messages.message import EMPTY, Message, as_message, message, message_of

_log = logging.getLogger(__name__)

_SWITCH_S = 0.001
"""Longest turn of a thread of the interpreter; the port's buffer may hold no more than 20 ms."""
_WAIT_S = 0.05
_READS_PER_STEP = 64
"""Most reads taken before they are followed, should decoding fall behind: the history must reach back."""
_HISTORY_S = 10.0  # time of samples that are kept before a run
_AFTER_PRETRIGGER_S = 4.0
"""The history reaches so much further back than a pretrigger: a release is confirmed only after a while."""
_CONNECT_S = 60.0  # the owner must send the first command within this time
_HEALTH_PERIOD_S = 0.4
_STEP_PERIODS_S = {Latency.BATCHED: 0.8, Latency.IDENTIFIED: 0.1}
"""Between two steps that nobody waits for: a step costs about the same for few samples as for many."""
_WATCHED_PAUSE_S = 0.015
"""Time for bytes to collect in the port before each read; here for a user who is to see them within 50 ms."""
_PAUSE_S = 0.075
_AWAITING_PAUSE_S = 0.003
_ARMING_WAIT_S = 0.3  # a disk that works makes a journal in some milliseconds
_ARMING_S = 5.0
_ENDED_BY_OPERATOR = (messages.EndReason.STOPPED, messages.EndReason.INTERRUPTED)


class PollSchedule:
    """Decides how often the engine reads and steps; `low_latency` while somebody watches the samples."""

    def __init__(self, *, low_latency: bool) -> None:
        self._is_watched = low_latency
        self._due_s = 0.0

    def pause_s(self, latency: Latency) -> float:
        if latency is Latency.IMMEDIATE:
            return _AWAITING_PAUSE_S
        return _WATCHED_PAUSE_S if self._is_watched else _PAUSE_S

    def wait(self, latency: Latency, wait: Callable[[float], object], longest_s: float = math.inf) -> None:
        """Wait for the next step by `wait`, which takes seconds and may return earlier."""
        if self._is_watched or latency not in _STEP_PERIODS_S:
            return
        wait(max(0.0, min(self._due_s - time.perf_counter(), longest_s)))
        self._due_s = time.perf_counter() + _STEP_PERIODS_S[latency]


class Engine:
    """A connected device, and the runs recorded from it, one after another.

    `connect` has the port's settings complete.
    """

    def __init__(
        self,
        connect: messages.Connect,
        stand: Stand,
        gauges: Gauges,
        stream: live_stream.LiveStream,
        ring: RingWriter,
        commands: CommandReader[messages.Command],
        events: EventSender[messages.Event],
    ) -> None:
        self._port = connect.port
        self.is_simulated = connect.port.simulated or is_simulated_device(
            stream.identity, stream.port_identity
        )
        self._stand = stand
        self._gauges = gauges
        self._stream = stream
        self._ring = ring
        self._commands = commands
        self._events = events
        self._poll_schedule = PollSchedule(low_latency=connect.low_latency)
        self._rate_hz = stream.rate_hz
        self._history = live_stream.ReadHistory(round(_HISTORY_S * self._rate_hz))
        self._writer = WriterClient.start()
        self._live = LiveIdentifier(
            str(ring.path), lambda first: stream.time_base(first, self._history.next_index, recent=True)
        )
        self._recording: Recording | None = None
        self._is_live_prepared = False
        self._arming: Arming | None = None
        self._sequence = run_setup.RunSequence()
        self._last_slip: ObservedSlip | None = None
        self._sleep_prevention = SleepPrevention()
        self._disk = DiskSpaceMonitor(Path(connect.directory) if connect.directory else None)
        self._health_due_s = 0.0
        self._is_asked_to_quit = False
        self._is_quitting = False

    def run(self) -> None:
        """Work until told to quit, or the owner is gone. An error is raised when the run is stored."""
        try:
            while not (self._is_quitting and self._recording is None):
                self._step()
        except StreamEndedError as error:
            self._finish(error.reason, message_of(error))
            raise
        except BaseException as error:
            self._finish(messages.EndReason.WRITE_ERROR, message_of(error))
            raise
        finally:
            self._sleep_prevention.end()
            self._disk.stop()
            self._live.stop()
            if self._writer.failure is None:
                self._writer.stop()
            else:
                self._writer.abandon()

    def ask_to_quit(self) -> None:
        """Make `run` end a run, keep it, and return; may be called at any moment, as by a signal."""
        self._is_asked_to_quit = True

    def _step(self) -> None:
        latency = self._latency()
        self._stream.set_read_pause(self._poll_schedule.pause_s(latency))
        ends_s = math.inf if self._recording is None else self._recording.ends_s
        self._poll_schedule.wait(latency, self._commands.wait, ends_s)
        self._take_reads()
        self._follow_stream()
        while (command := self._commands.take()) is not None:
            self._execute(command)
        self._follow_arming()
        if self._is_asked_to_quit:
            self._is_quitting = True
            self._end_all(messages.EndReason.STOPPED)
        elif self._commands.is_closed:
            self._continue_alone()
        self._follow_recording()
        self._send_health()

    def _latency(self) -> Latency:
        if self._stream.is_disconnected:
            return Latency.INTERACTIVE
        latency = Latency.BATCHED if self._recording is None else self._recording.latency
        is_pair = bool(self._port.relative_url)  # one of two devices that comes back is joined to the other
        return Latency.IDENTIFIED if is_pair and latency is Latency.BATCHED else latency

    def _take_reads(self) -> None:
        reads, wait_s = list[live_stream.DecodedRead](), _WAIT_S
        try:
            while len(reads) < _READS_PER_STEP and (read := self._stream.next_read(wait_s)) is not None:
                reads.append(read)
                wait_s = 0.0
        finally:  # also what came before the end of a stream
            for rows in live_stream.concatenate(tuple(rows for read in reads for rows in read.rows)):
                self._ring.append(rows.counts, rows.status)
            for read in reads:
                self._history.add(read)
            if self._recording is not None and reads:
                self._recording.add(reads)

    def _follow_stream(self) -> None:
        for event in self._stream.take_events():
            if not isinstance(event, live_stream.StreamNotice):
                self._events.send(event)
            if self._recording is None:
                self._send_idle(event.message)
            elif isinstance(event, messages.Reconnecting):
                self._recording.show_note(event.message)
            else:
                self._recording.add_note(event.message)
        fault = self._stream.fault
        if fault is not None and self._recording is not None:
            self._end_all(fault.reason, fault.message)

    def _execute(self, command: messages.Command) -> None:
        match command:
            case messages.Arm(run, count):
                self._begin(run, count)
            case messages.Stop(reason):
                self._end_all(reason)
            case messages.Quit():
                self.ask_to_quit()
            case messages.Connect():
                raise AcquisitionError("this engine is connected already: start another one for another port")

    def _begin(self, run: messages.RunSettings, count: int) -> None:
        if self._arming is not None:
            self._send_idle(message("A run is being armed already: wait until its disk answers"))
        elif self._recording is not None:
            self._recording.show_note(message("A run is being recorded already: stop it before the next one"))
        elif self._stream.is_disconnected:
            self._refuse(
                messages.EndReason.DEVICE_LOST,
                message("the device is away: plug it in, and record when it is back"),
            )
        else:
            self._sequence.begin(run, count)
            self._arm(run)

    def _follow_arming(self) -> None:
        """Begin the run whose journal is there, or refuse it where its disk gives no answer."""
        arming = self._arming
        if arming is None:
            return
        try:
            prepared = arming.poll(_ARMING_S)
        except DiskSpaceError as error:
            self._arming = None
            self._refuse(messages.EndReason.DISK_FULL, message_of(error))
        except JournalError as error:
            self._arming = None
            self._refuse(end_reason(error), message_of(error))
        else:
            if prepared is not None:
                self._arming = None
                self._start_recording(arming, *prepared)

    def _refuse(self, reason: messages.EndReason, message: Message) -> None:
        _log.warning("run refused (%s): %s", reason, message)
        self._sequence.stop()
        self._sleep_prevention.end()
        self._events.send(messages.RunEnded("", reason, 0, 0, 0, 0, 0, self._rate_hz, message=message))
        self._send_idle()

    def _arm(self, run: messages.RunSettings) -> None:
        """Arm a run; its disk is asked in a thread, which is waited for as long as nobody notices."""
        run_setup.check_run_settings(run)
        metadata = run_setup.build_metadata(
            run, self._stand, self._gauges, self._stream, simulated=self.is_simulated
        )
        self._history.span = round(max(_HISTORY_S, run.pretrigger_s + _AFTER_PRETRIGGER_S) * self._rate_hz)
        folder, demand = Path(run.directory).absolute(), self._disk_demand()

        def prepare() -> tuple[Journal, Message]:
            note = check_disk_space(folder, run, demand)
            self._disk.begin(folder, demand)
            # The journal is made last: an earlier fault leaves none open.
            return run_setup.create_run_journal(self._port, run, metadata), note

        self._arming = Arming(run, metadata, prepare)
        self._arming.wait(_ARMING_WAIT_S)
        self._follow_arming()

    def _start_recording(self, arming: Arming, journal: Journal, note: Message) -> None:
        run, metadata = arming.run, arming.metadata
        if self._writer.failure is not None:
            self._writer.abandon()
            self._writer = WriterClient.start()
        context = RecordingContext(
            self._stream.read_queue,
            self._history,
            self._writer,
            self._stream.time_base,
            self._events.send,
            self._port.simulated,
        )
        self._recording = Recording(run, metadata, self._rate_hz, journal, context, self._last_slip)
        _log.info("armed: series %s, trigger %s, journal %s", run.series, run.trigger, journal.path)
        self._sleep_prevention.begin()
        self._is_live_prepared = False
        if self._stream.note:
            self._recording.add_note(as_message(self._stream.note))
        if note:
            self._recording.show_note(note)

    def _end_all(self, reason: messages.EndReason, message: Message = EMPTY) -> None:
        """End the run and keep it; one that is stopped, or armed itself, and only waits leaves nothing."""
        self._sequence.stop()
        if self._arming is not None:
            self._arming.abandon()
            self._arming = None
            self._refuse(reason, message)
        if self._recording is not None:
            keep_rest = not (self._sequence.is_repeat or reason in _ENDED_BY_OPERATOR)
            self._recording.end(reason, message, keep_rest=keep_rest)

    def _continue_alone(self) -> None:
        """The owner is gone: continue only a run that comes to its end by itself."""
        self._is_quitting = True
        self._sequence.stop()
        if self._arming is not None or (self._recording and not self._recording.is_unattended):
            self._end_all(messages.EndReason.INTERRUPTED, message("the program that recorded ended"))

    def _follow_recording(self) -> None:
        recording = self._recording
        if recording is None:
            return
        if not recording.is_ending:
            self._follow_live(recording)
        ended = recording.poll()
        if ended is None:
            return
        _log.info(
            "run ended (%s): %d samples in %s %s", ended.ended, ended.samples, ended.path, ended.message
        )
        self._live.end_run()
        self._last_slip = recording.observed_slip or self._last_slip
        self._recording = None
        ended, following = self._sequence.next_after(ended)
        self._events.send(ended)
        if following is None:
            self._sleep_prevention.end()
        else:
            self._arm(following)
        if self._commands.is_closed and not self._is_asked_to_quit:
            self._leave_note(recording, ended)
        if following is None:
            self._send_idle()

    def _leave_note(self, recording: Recording, ended: messages.RunEnded) -> None:
        """The owner is gone: tell the next one."""
        now = datetime.datetime.now().astimezone()
        series = recording.metadata.series or ""
        run = UnattendedRun(recording.directory, ended.ended, now, ended.path, series, ended.message)
        leave_note(run)

    def _follow_live(self, recording: Recording) -> None:
        if not self._is_live_prepared and recording.expects_release:
            self._is_live_prepared = True
            self._live.prepare()
        now_s = self._history.next_index / self._rate_hz
        result = self._live.poll(recording.confirmed_start_index, recording.metadata, now_s)
        if result is not None:
            self._events.send(result)
            if result.is_enough:
                recording.end_if_enough()

    def _finish(self, reason: messages.EndReason, message: Message) -> None:
        self._sequence.stop()
        if self._arming is not None:
            self._arming.abandon()
        if self._recording is not None:
            self._recording.end(reason, message)
        while self._recording is not None:
            time.sleep(_WAIT_S)
            self._follow_recording()
            self._send_health()

    def _send_idle(self, note: Message = EMPTY) -> None:
        is_away, states = self._stream.is_disconnected, messages.PullbackState
        state = states.CONNECTING if is_away else states.IDLE
        self._events.send(messages.StateChanged(state, self._history.next_index / self._rate_hz, note))

    def _send_health(self) -> None:
        now_s = time.perf_counter()
        if now_s < self._health_due_s:
            return
        self._health_due_s = now_s + _HEALTH_PERIOD_S
        self._follow_disk()
        clock, losses = self._stream.recent_clock(), self._stream.losses
        self._events.send(
            messages.Health(
                rate_hz=self._rate_hz if clock is None else clock.rate_hz,
                samples=losses.samples,
                missing=losses.missing,
                missing_estimated=losses.missing_estimated,
                damaged=losses.damaged,
                overloaded=losses.overloaded,
                free_disk_bytes=self._disk.free_bytes,
                bytes_per_s=self._disk_demand().bytes_per_s,
            )
        )

    def _follow_disk(self) -> None:
        recording = self._recording
        if recording is None or recording.is_ending:
            return
        try:
            warning = self._disk.check(recording.journal_bytes)
        except DiskSpaceError as error:
            _log.warning("%s", error)
            self._end_all(messages.EndReason.DISK_FULL, message_of(error))
        else:
            recording.add_note(warning)

    def _disk_demand(self) -> DiskDemand:
        return DiskDemand(self._rate_hz, self._rate_hz * self._history.bytes_per_sample)


def serve(
    commands: CommandReader[messages.Command], events: EventSender[messages.Event], folder: Path
) -> None:
    """Execute the first command, `Connect`, and run the engine; the ring is made in `folder`."""
    connect = commands.take(timeout_s=_CONNECT_S)
    if not isinstance(connect, messages.Connect):
        raise AcquisitionError("an engine is told what to connect to first: send Connect")
    events.send(messages.StateChanged(messages.PullbackState.CONNECTING, 0.0))
    stand, gauges = load_stand(connect.stand_file), load_gauges(connect.gauges_file)
    connect = replace(connect, port=run_setup.complete_port_settings(connect.port, gauges.device))
    with (
        live_stream.open_stream(connect.port, gauges) as stream,
        create_ring(folder / "live.ring", ring_capacity(stream.rate_hz), stream.rate_hz, gauges) as ring,
    ):
        engine = Engine(connect, stand, gauges, stream, ring, commands, events)
        signal.signal(signal.SIGTERM, lambda *_: engine.ask_to_quit())
        device = stream.identity
        _log.info("connected: %s %s, %g Hz", device.name, device.firmware, stream.rate_hz)
        facts = device.name, device.firmware, stream.rate_hz, str(ring.path)
        events.send(messages.Connected(*facts, simulated=engine.is_simulated))
        events.send(messages.StateChanged(messages.PullbackState.IDLE, 0.0))
        engine.run()


def main() -> int:
    """Run the process. Whatever ends it early is reported in one `Failed` event."""
    start_log("engine")
    ignore_session_signals()
    sys.setswitchinterval(_SWITCH_S)
    events: EventSender[messages.Event] = EventSender(
        reserve_stdout(), lambda event: isinstance(event, messages.Health | messages.LiveResult)
    )
    try:
        with live_folder() as folder:
            serve(CommandReader.of_stdin(LineDecoder(messages.decode_command).feed), events, folder)
    except (AcquisitionError, ConfigError, DriverError, RunError, OSError) as error:
        _log.error("engine failed: %s", error)
        events.send(messages.Failed(message_of(error)))
        return 1
    except Exception as error:
        _log.exception("engine failed")
        failure = message(
            "Slipstand's engine failed ({kind}: {error}). Please report this",
            kind=type(error).__name__,
            error=error,
        )
        events.send(messages.Failed(failure))
        raise
    finally:
        events.close()
    return 0
