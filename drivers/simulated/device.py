"""The simulated device: paced by a clock of its own, never waiting for whoever reads it."""

from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.errors import SettingsError
from drivers.simulated.commands import Command, CommandKind
from drivers.simulated.disturbances import Disturbance, DisturbanceKind, DisturbanceSchedule
from drivers.simulated.faults import FaultRates, FrameDamager
from drivers.simulated.stream_sender import (
    DeviceClock,
    Signal,
    Stream,
    StreamSender,
    TransmissionLog,
    WireOutput,
)
from drivers.simulated.transport import Transport
from drivers.simulated.wire import SimulatedProtocol

_SEQUENCES = 1 << 32


@dataclass(frozen=True, slots=True)
class DeviceSetup:
    """What a simulated device is like.

    Attributes
    ----------
    rate_hz : float
        Sample rate at power-on (Hz), as the device says it.
    clock_ppm : float
        How much the device's clock is fast (1e-6).
    rate_error : float
        By what fraction it samples faster than it says, its times being right.
    first_sequence : int
        Number of sample 0, which counts on modulo 2**32.
    first_time_s : float
        What its clock reads at sample 0 (s).
    faults : FaultRates
        Damage done to its frames.
    disturbances : tuple of Disturbance
        What happens to it, counted from the start of a session.
    seed : int or None
        Makes the damage repeatable.
    began_ns : int or None
        Host's monotonic time at which the stand's own time is 0 for good, so that several devices show one
        motion; None begins with each session.
    """

    rate_hz: float
    clock_ppm: float = 0.0
    rate_error: float = 0.0
    first_sequence: int = 0
    first_time_s: float = 0.0
    faults: FaultRates = field(default_factory=FaultRates)
    disturbances: tuple[Disturbance, ...] = ()
    seed: int | None = None
    began_ns: int | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.first_sequence < _SEQUENCES:
            raise SettingsError(
                f"first_sequence {self.first_sequence} is no counter: give 0 to {_SEQUENCES - 1}"
            )


class SimulatedDevice:
    """Firmware of the simulated amplifier; `step` it as often as it asks.

    Sample k is taken at k / rate of the device's own clock, counted from the start of the stream. A
    stream starts when asked for, or with the opening of the port.

    The stand's own time begins with a session, which is a stream that is started afresh. A stream that
    is started after the one before was torn (cable, power, or a reader that left without a word) goes on
    with the session: the stand has not waited. One that began by itself then may be stopped and started once.

    Parameters
    ----------
    transport : Transport
        Where bytes go and commands come from.
    packing : Packing
        Protocol spoken.
    signal_at : callable (rate_hz, started_s)
        Makes the signal of a new stream: samples a second and first sample, both on the stand's time.
    setup : DeviceSetup
    """

    _NO_STREAM_S = 0.02

    def __init__(
        self,
        transport: Transport,
        packing: SimulatedProtocol,
        signal_at: Callable[[float, float], Signal],
        setup: DeviceSetup,
    ) -> None:
        self._transport = transport
        self._packing = packing
        self._signal_at = signal_at
        self._setup = setup
        self._rate_hz = setup.rate_hz
        self._script = DisturbanceSchedule(setup.disturbances)
        damager = FrameDamager(setup.faults, packing.line_end, setup.seed)
        self._line = WireOutput(transport, packing, damager, self._script)
        self._commands = packing.command_parser()
        self._reader_is_there = False
        self._cable_fault: DisturbanceKind | None = None
        self._stream: Stream | None = None
        self._was_interrupted = False
        self._resumed_by_itself = False
        self._session_ns: int | None = None
        self.log = TransmissionLog(setup.rate_hz, setup.rate_hz)
        """Of the running stream, or of the last one."""
        self.earlier_logs: list[TransmissionLog] = []
        """Of the streams of this session before that one."""
        self.streams = 0
        """Streams started until now."""

    @property
    def is_streaming(self) -> bool:
        """Tell whether samples are being sent."""
        return self._stream is not None

    @property
    def disturbances(self) -> tuple[Disturbance, ...]:
        """What is planned for this session and what was asked for in it, with its times."""
        return self._script.disturbances

    @property
    def is_plugged_in(self) -> bool:
        """Tell whether there is a port."""
        return self._cable_fault is None

    def disturb(self, disturbance: Disturbance, now_ns: int) -> None:
        """Let something happen, at its time or at once."""
        self._script.add(disturbance, self._time_s(now_ns))

    def step(self, now_ns: int) -> float:
        """Do what is due at `now_ns` of the host's monotonic clock; return seconds to wait at most."""
        self._follow_cable(now_ns)
        received = self._transport.receive()
        if received is None:
            self._note_absent_reader()
        else:
            self._receive_commands(received, now_ns)
        return self._stream.send_due(now_ns, self._reader_is_there) if self._stream else self._NO_STREAM_S

    def _time_s(self, now_ns: int) -> float:
        """The stand's own time; before the first session, since the first step."""
        if self._session_ns is None:
            self._session_ns = now_ns
        return (now_ns - self._session_ns) * 1e-9

    def _follow_cable(self, now_ns: int) -> None:
        fault = self._script.cable_fault(self._time_s(now_ns))
        if fault is self._cable_fault:
            return
        if self._cable_fault is None:
            self._transport.unplug()
            self._reader_is_there = False
            self._was_interrupted = self._was_interrupted or self.is_streaming
        if fault is DisturbanceKind.POWER:
            self._stream = None
            self._rate_hz = self._setup.rate_hz
        if fault is None:
            self._transport.plug_in()
        self._cable_fault = fault

    def _note_absent_reader(self) -> None:
        if not self._reader_is_there:
            return
        self._reader_is_there = False
        if self._transport.resets_device:
            self._stream = None
        self._was_interrupted = self.is_streaming

    def _receive_commands(self, received: bytes, now_ns: int) -> None:
        if not self._reader_is_there:
            self._reader_is_there = True
            self._commands = self._packing.command_parser()
            if self._packing.streams_on_open and self._stream is None:
                was_torn = self._was_interrupted
                self._start(now_ns)
                self._resumed_by_itself = was_torn
        for command in self._commands.feed(received):
            self._respond(command, self._execute(command, now_ns), now_ns)

    def _respond(self, command: Command, is_done: bool, now_ns: int) -> None:
        answer = self._packing.respond(command, is_done, self._rate_hz)
        if answer and not self._is_silent(now_ns):
            self._transport.send(answer)

    def _execute(self, command: Command, now_ns: int) -> bool:
        """Do what is asked for; tell whether it can be."""
        match command.kind:
            case CommandKind.START if self._stream is None:
                self._start(now_ns)
            case CommandKind.STOP:
                self._stream = None
            case CommandKind.RATE:
                is_possible = self._stream is None and 1.0 <= command.rate_hz <= self._packing.max_rate_hz
                self._rate_hz = command.rate_hz if is_possible else self._rate_hz
                return is_possible
        return True

    def _is_silent(self, now_ns: int) -> bool:
        return self._script.wire_fault(self._time_s(now_ns)) is DisturbanceKind.STALL

    def _start(self, now_ns: int) -> None:
        if self._was_interrupted or self._resumed_by_itself:
            self.earlier_logs.append(self.log)
        else:
            self.earlier_logs = []
            self._session_ns = now_ns if self._setup.began_ns is None else self._setup.began_ns
            self._script.restart()
        self._was_interrupted = self._resumed_by_itself = False
        self.streams += 1
        self._stream = self._new_stream(now_ns)

    def _new_stream(self, now_ns: int) -> Stream:
        setup = self._setup
        device_rate_hz = self._rate_hz * (1.0 + setup.rate_error)
        true_rate_hz = device_rate_hz * (1.0 + setup.clock_ppm * 1e-6)
        self.log = TransmissionLog(self._rate_hz, true_rate_hz, self._time_s(now_ns))
        signal = self._signal_at(true_rate_hz, self.log.started_s)
        return self._make_stream(signal, device_rate_hz, now_ns)

    def _make_stream(self, signal: Signal, device_rate_hz: float, now_ns: int) -> Stream:
        clock = DeviceClock(device_rate_hz, self._setup.first_sequence, self._setup.first_time_s)
        return StreamSender(self._line, signal, clock, self.log, now_ns)
