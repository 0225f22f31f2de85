"""The simulated stand: motion, gauges, converter and device of one set of options."""

import time
from collections.abc import Callable

import msgspec
import numpy as np

from analysis.motion.two_mass import Motion
from app.simulated_stand.motion import RepeatedPullback, released_motion, stand_truth
from app.simulated_stand.options import Gesture, SimulatedStandOptions
from app.simulated_stand.signal import StandSignal, SwappedChannels
from app.simulated_stand.truth import Truth
from config.files import load_gauges, load_stand
from drivers.registry import find_driver
from drivers.simulated.device import DeviceSetup, make_device
from drivers.simulated.faults import Disturbance, FaultRates, parse_disturbance
from drivers.simulated.stream_sender import Signal
from drivers.simulated.transport import Transport


class SimulatedStandDevice:
    """A simulated stand on a transport. The caller runs `step` as often as it asks for.

    Raises ConfigError, DriverError, MotionError if options, stand and gauges contradict each other. The
    transport is closed by the caller. `on_truth` is called at each start and end of a stream and at each
    release.
    """

    def __init__(
        self, options: SimulatedStandOptions, transport: Transport, on_truth: Callable[[Truth], None]
    ) -> None:
        self._options = options = options.completed()
        self.is_over = False
        self._on_truth = on_truth
        self._transport = transport
        self._true = stand_truth(options, load_stand(options.stand_file))
        self._timetable = options.timetable()
        released = released_motion(self._true, self._timetable, options.effects)
        self._motion = RepeatedPullback(
            self._true.pullback_m,
            released,
            self._timetable,
            options.plate_offset_m,
            on_demand=options.on_demand,
            release_from=self._release_from,
        )
        self._gauges = load_gauges(options.gauges_file)
        # Compiles the motion after a release before a reader waits for it.
        released.sample_displacements(np.array([0.1]))
        settings, self._is_swapped = options.device_settings()
        protocol = find_driver(options.protocol).make_simulated(settings)
        self._max_count = protocol.max_count
        self._device = make_device(transport, protocol, self._signal_at, _setup(options))
        self._published: tuple[object, ...] = ()

    def step(self, now_ns: int) -> float:
        """Do what is due; return seconds to wait at most."""
        wait_s = self._device.step(now_ns)
        device = self._device
        state = device.streams, device.is_streaming, device.is_plugged_in, device.disturbances
        if (turn := (*state, self._releases())) != self._published:
            self._published = turn
            self._on_truth(self.truth())
        return wait_s

    def truth(self) -> Truth:
        tests = self._motion.first_tests(self._releases())
        return Truth(
            port=self._transport.url,
            stand=self._true,
            options=self._options,
            timetable=self._timetable,
            release_s=[test.release_s for test in tests],
            plate_offset_m=[test.offset_m for test in tests],
            residual_displacement_m=self._motion.released.residual_displacement_m,
            streams=self._device.streams,
            wire=self._device.log,
            earlier=self._device.earlier_logs,
            disturbances=list(self._device.disturbances),
        )

    @property
    def has_reader(self) -> bool:
        return self._device.has_reader

    def disturb(self, disturbance: Disturbance | Gesture, now_ns: int) -> None:
        match disturbance:
            case Gesture.PULL:
                self._motion.request(self._device.time_s(now_ns))
            case Gesture.END:
                self.is_over = True
            case Gesture.EARLY:
                self._motion.let_go_early(self._options.early_release_m)
            case Disturbance():
                self._device.disturb(disturbance, now_ns)

    def _release_from(self, pullback_m: float) -> Motion:
        true = msgspec.structs.replace(self._true, pullback_m=pullback_m)
        return released_motion(true, self._timetable, self._options.effects)

    def _signal_at(self, rate_hz: float, started_s: float) -> Signal:
        if not self._device.earlier_logs:  # the stand's own time begins anew
            self._motion.restart()
            if self._options.early_release_m is not None:
                self._motion.let_go_early(self._options.early_release_m)
        lag_s = self._options.lag_s
        timing = rate_hz, started_s - lag_s
        signal = StandSignal(self._motion, self._gauges, self._options, *timing, self._max_count)
        return SwappedChannels(signal) if self._is_swapped else signal

    def _releases(self) -> int:
        """Releases until the last sample of this session."""
        log = self._device.log
        return self._motion.count_releases(log.started_s + log.samples / log.true_rate_hz)


def _setup(options: SimulatedStandOptions) -> DeviceSetup:
    unix_s = options.start_at_unix_s
    return DeviceSetup(
        rate_hz=options.sample_rate_hz,
        clock_ppm=options.clock_ppm,
        rate_error=options.rate_error,
        first_sequence=options.first_sequence,
        first_time_s=options.first_time_s,
        faults=FaultRates(options.drop, options.flip, options.truncate),
        disturbances=tuple(parse_disturbance(text) for text in options.disturbances),
        seed=options.seed,
        began_ns=None if unix_s is None else time.perf_counter_ns() - round((time.time() - unix_s) * 1e9),
    )
