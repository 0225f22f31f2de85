"""Follows a run from its first row in the ring to the newest, and identifies it again and again."""

import contextlib
import math
import time

from analysis.averaging import BlockAverager, block_size, mask
from analysis.live import LiveIdentification, LiveState
from analysis.record import Record
from analysis.synthetic import Truth, simulate_record
from app.acquisition.errors import RingError
from app.acquisition.messages import ClockUpdate, FollowRun, LiveAnswer, LiveCommand, LiveResult
from app.acquisition.ring import RingReader, RingRows, open_ring
from app.child_process import CommandReader, EventSender
from app.runs.analysis_input import build_record
from drivers.arrays import Floats
from drivers.clock import TimeBase
from drivers.samples import ABSENT_BY_GAUGE, SampleStatus

PERIOD_S = 0.04
"""Between two answers: 25 per second look continuous on a screen. Longer where one takes over half of it."""
_IDLE_S = 1.0
_FOLLOWED_S = 30.0
"""After the release. No test needs more than 20 s; a run of fixed duration may last for hours."""

_KINDS_OF_UPDATES = 3  # a search, a test of its law, a refinement


def serve(commands: CommandReader[LiveCommand], events: EventSender[LiveAnswer]) -> None:
    """Follow one run after another until the commands end."""
    command: LiveCommand | None = None
    while not commands.is_closed:
        command = command or commands.take(_IDLE_S)
        if isinstance(command, FollowRun):
            with contextlib.suppress(RingError), open_ring(command.ring_path) as ring:
                command = _follow(RunFollower(ring, command), commands, events)
                continue
        command = None


def _follow(
    run: "RunFollower", commands: CommandReader[LiveCommand], events: EventSender[LiveAnswer]
) -> LiveCommand | None:
    """Answer at an even pace until the run or the commands end; return the command that ended it."""
    while not commands.is_closed:
        while (command := commands.take()) is not None:
            if not isinstance(command, ClockUpdate):
                return command
            run.update_clock(command.time_base)
        began, computed = time.perf_counter(), time.process_time()
        answer = run.answer()
        if answer is not None:
            events.send(answer)
        # Other processes get as much processor time as the answer took.
        time.sleep(max(began + PERIOD_S - time.perf_counter(), time.process_time() - computed))
    return None


def warm_up() -> None:
    """Compile, or load from the cache, what an identification needs."""
    synthetic = simulate_record(Truth(friction_static=0.13, tilt_rad=1e-3, rate_hz=500.0, duration_s=4.0))
    live = LiveIdentification()
    for _ in range(_KINDS_OF_UPDATES):
        live.update(synthetic)


class RunFollower:
    """Identifies a run from all its rows until now."""

    def __init__(self, ring: RingReader, follow: FollowRun) -> None:
        self._ring = ring
        self._follow = follow
        self._time_base = follow.time_base
        self._next_row = follow.first_row
        self._last_row = math.inf
        self._rows = BlockAverager(block_size(ring.rate_hz))
        self._identification = LiveIdentification()

    def answer(self) -> LiveAnswer | None:
        """Identify the run; None without new rows, or when it was followed long enough."""
        if self._next_row > self._last_row:  # before reading, which costs as much as following
            return None
        rows = self._ring.read_since(self._next_row)
        if not len(rows):
            return None
        self._next_row = rows.end_index
        self._last_row = min(self._last_row, self._next_row + _FOLLOWED_S * self._ring.rate_hz)
        self._take(rows)
        time_s, table_m, relative_m = self._rows.columns
        if not len(time_s):
            return None
        state = self._identification.update(self._record(time_s - time_s[0], table_m, relative_m))
        return LiveAnswer(self._follow.first_row, result_of(state, float(time_s[0])))

    def update_clock(self, time_base: TimeBase) -> None:
        self._time_base = time_base

    def _take(self, rows: RingRows) -> None:
        if rows.lost:
            self._rows.discard_partial()
        self._rows.add(
            rows.time_s,
            mask(rows.table_m, (rows.status & (ABSENT_BY_GAUGE[0] | SampleStatus.OVERLOAD_TABLE)) != 0),
            mask(rows.relative_m, (rows.status & (ABSENT_BY_GAUGE[1] | SampleStatus.OVERLOAD_RELATIVE)) != 0),
        )

    def _record(self, time_s: Floats, table_m: Floats, relative_m: Floats) -> Record:
        made = build_record(self._follow.metadata, time_s, table_m, relative_m, self._time_base)
        return made.replace(gauge_2_measures_plate=False)  # the ring holds plate against table in any case


def result_of(state: LiveState, origin_s: float) -> LiveResult:
    """Convert a state of the identification to an event; `origin_s` is its time 0 in the ring."""
    return LiveResult(
        time_s=origin_s + state.time_s,
        friction_dynamic=state.friction_dynamic,
        period=state.period_s,
        damping_n1=state.damping_n1_per_s,
        law=state.law or "",
        slip_end_s=None if state.slip_end_s is None else origin_s + state.slip_end_s,
        narrowing=state.narrowing,
        may_stop=state.may_stop,
        is_enough=state.is_enough,
        friction_dynamic_plate=state.friction_dynamic_plate,
    )
