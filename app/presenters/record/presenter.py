"""What the Record screen does: engine events and live rows in, one state out."""

import datetime
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from app.acquisition.messages import (
    Connected,
    Event,
    Health,
    LiveResult,
    PullbackState,
    RunEnded,
    RunSettings,
    RunStarted,
    Standing,
    StateChanged,
)
from app.acquisition.pullback.centring import Excursion, plate_room, usual_excursion
from app.acquisition.ring import RingRows
from app.presenters import numbers, results
from app.presenters.analysed import AnalysedRun
from app.presenters.record.guidance import Situation, Stage, Where, guide
from app.presenters.record.header import GaugeWatch, disk_chip, lost_chip, rate_text
from app.presenters.record.live import LiveTraces
from app.presenters.record.running import running_of
from app.presenters.record.state import Action, Header, Readings, RecordState, RunChoices, Running
from app.presenters.screen import Presenter, Progress
from config.schema import Gauges, Settings, Stand

RECORDING = frozenset(
    {
        PullbackState.RECENTRE,
        PullbackState.ZERO,
        PullbackState.PULLING,
        PullbackState.HELD,
        PullbackState.ARMED,
        PullbackState.RELEASED,
        PullbackState.SLIPPING,
        PullbackState.NO_SLIP,
        PullbackState.TAIL,
        PullbackState.RECORDING,
    }
)
_NOTHING_KNOWN = frozenset({PullbackState.ZERO, PullbackState.PULLING, PullbackState.RECORDING})
"""States in which what was known is of another run, or of a table let down."""
_READINGS_EVERY_S = 0.1


class Recorder(Protocol):
    """The engine as far as Record needs it."""

    def arm(self, run: RunSettings) -> None:
        """Record one run."""

    def stop(self) -> None:
        """End the run and keep it."""

    def new_rows(self) -> RingRows | None:
        """Samples since the last call; None without any."""


@dataclass(frozen=True, slots=True)
class Bench:
    """What Record must know of the stand: settings, series, where runs go."""

    stand: Stand
    gauges: Gauges
    all_series: tuple[str, ...]
    directory: Path
    today: Callable[[], datetime.date] = datetime.date.today


class RecordPresenter(Presenter[RecordState]):
    """Leads through one pullback after another.

    Parameters
    ----------
    recorder : Recorder
    bench : Bench
    connect_device : callable
        Leads to where a device is connected.
    """

    def __init__(
        self, recorder: Recorder, bench: Bench, connect_device: Callable[[], None] = lambda: None
    ) -> None:
        choices = RunChoices(series=bench.all_series[0], all_series=bench.all_series)
        super().__init__(RecordState(guidance=guide(Situation()), choices=choices))
        self._recorder = recorder
        self._bench = bench
        self._connect_device = connect_device
        self._watches = self._new_watches()
        self._live = LiveTraces(bench.gauges.table.range_m, bench.gauges.relative.range_m)
        self._engine: PullbackState | None = None
        self._after: Stage | None = None
        self._asked = False
        self._note = ""
        self._standing = Standing()
        self._waiting_for = ""
        self._pixels = 800
        self._read_s = float("-inf")
        self._simulated = False
        self._ended: RunEnded | None = None
        self._true_friction: float | None = None
        self._usual_operator = ""

    @property
    def is_recording(self) -> bool:
        """Tell whether a run is under way, or is still being stored."""
        return self._engine in RECORDING or self._engine is PullbackState.CLOSING

    # --- what the operator does ---

    def arm(self) -> None:
        """Record the next pullback, also straight from the last result."""
        if Action.ARM not in self.state.allowed:
            return
        self._leave_result()
        self._asked = True
        self._recorder.arm(self._run_settings())
        self._refresh()

    def stop(self) -> None:
        """End the recording now and keep it."""
        if Action.STOP in self.state.allowed:
            self._asked = True
            self._recorder.stop()
            self._refresh()

    def next(self) -> None:
        """Leave the result and make ready for the next run."""
        if Action.NEXT in self.state.allowed:
            self._leave_result()
            self._refresh()

    def connect_device(self) -> None:
        """Go where a device is connected."""
        self._connect_device()

    def choose_series(self, code: str) -> None:
        """Series of the next run: its pullback becomes the target."""
        if self.state.choices.editable and not self.state.choices.series_fixed:
            self._choose(series=code)

    def set_operator(self, name: str) -> None:
        """Who records."""
        self._choose(operator=name)

    def set_note(self, note: str) -> None:
        """Remark kept with the next run."""
        self._choose(note=note)

    def resized(self, pixels: int) -> None:
        """Width of the plots."""
        self._pixels = max(pixels, 64)

    # --- what happens elsewhere ---

    def connecting(self, device: str, waiting_for: str = "") -> None:
        """A port is being opened; `waiting_for` says what is started before."""
        self._after = None
        self._true_friction = None
        self._waiting_for = waiting_for
        self._start_over(PullbackState.CONNECTING, Header(device=device))

    def simulate(self, series: str, true_friction: float) -> None:
        """The device is the simulated stand, which runs one series with a known truth."""
        self._simulated = True
        self._true_friction = true_friction
        self._choose(series=series, series_fixed=True, series_hint="The simulated stand runs this series.")
        self._refresh()

    def take_settings(self, settings: Settings) -> None:
        """Who records, unless somebody else has been written."""
        if self.state.choices.operator in ("", self._usual_operator):
            self._choose(operator=settings.operator)
        self._usual_operator = settings.operator

    def take_gauges(self, gauges: Gauges) -> None:
        """These calibrations are in use from the next connection on; they tell of age and range at once."""
        self._bench = replace(self._bench, gauges=gauges)
        self._watches = self._new_watches()

    def disconnected(self) -> None:
        """Nothing is connected any more; the result of the last run stays."""
        self._simulated = False
        self._start_over(None, Header())
        self._choose(series_fixed=False, series_hint="")

    def handle(self, event: Event) -> None:
        """Take one event of the engine."""
        if isinstance(event, StateChanged):
            self._came_to(event)
        elif isinstance(event, Connected):
            self._header(device=event.device, rate=rate_text(event.rate_hz))
        elif isinstance(event, Health):
            self._health(event)
        elif isinstance(event, LiveResult):
            self._change(running=running_of(event))
        elif isinstance(event, RunStarted):
            self._header(run=Path(event.path).stem)
        elif isinstance(event, RunEnded):
            self._run_ended(event)

    def tick(self) -> None:
        """Draw what has come since the last time."""
        rows = self._recorder.new_rows()
        if rows is None or not len(rows):
            return
        settled = self._live.settled
        self._live.append(rows)
        self._watch(rows)
        if not settled:
            self._change(traces=self._live.draw(self._pixels, self._pullback_m()))
        if rows.time_s[-1] - self._read_s >= _READINGS_EVERY_S:
            self._read_s = float(rows.time_s[-1])
            self._read()

    def working(self, path: str, progress: Progress) -> None:
        """The run is being identified."""
        if self._awaits(path):
            self._change(progress=progress)

    def show_result(self, run: AnalysedRun) -> None:
        """The run that ended has been identified."""
        if self._awaits(str(run.path)):
            self._finish(results.describe(run, self._true_friction))

    def show_failure(self, path: str, message: str) -> None:
        """The run that ended could not be identified."""
        if self._awaits(path) and self._ended is not None:
            self._finish(results.failure(message, path, self._ended.ended))

    # --- inside ---

    def _came_to(self, event: StateChanged) -> None:
        if event.state in RECORDING:
            self._leave_result()
        if event.state in _NOTHING_KNOWN:
            self._change(running=Running())
        self._live.mark(event.state, event.since_s, event.standing)
        self._standing = event.standing
        self._engine = event.state
        self._asked = False
        self._note = event.note
        self._waiting_for = ""
        self._refresh()

    def _run_ended(self, event: RunEnded) -> None:
        self._asked = False
        self._ended = event
        self._live.stop()
        if event.path:
            self._after = Stage.FINDING
            self._change(progress=Progress("Identifying"))
            self._refresh()
        else:
            self._finish(results.failure(event.message or "nothing was recorded", "", event.ended))

    def _health(self, health: Health) -> None:
        self._header(
            rate=rate_text(health.rate_hz), lost=lost_chip(health), disk=disk_chip(health.free_disk_bytes)
        )

    def _watch(self, rows: RingRows) -> None:
        today = self._bench.today()
        self._header(gauges=tuple(watch.look(rows, today) for watch in self._watches))

    def _read(self) -> None:
        newest = self._live.newest_m()
        table, relative = (numbers.millimetres(value, 2) for value in newest)
        self._change(readings=Readings(table, relative))
        self._refresh()

    def _awaits(self, path: str) -> bool:
        return self._after is Stage.FINDING and self._ended is not None and self._ended.path == path

    def _finish(self, result: results.Result) -> None:
        self._after = Stage.DONE
        self._change(result=result, progress=None)
        self._refresh()

    def _leave_result(self) -> None:
        if self._after is not None:
            self._after = None
            self._live.restart()
            self._change(result=None, progress=None)

    def _start_over(self, engine: PullbackState | None, header: Header) -> None:
        self._engine = engine
        self._asked = False
        self._note = ""
        self._standing = Standing()
        self._read_s = float("-inf")
        self._live.restart()
        self._live.history.clear()
        self._watches = self._new_watches()
        self._change(header=header, readings=Readings())
        if self._after is None:
            empty = self._live.draw(self._pixels, self._pullback_m())
            self._change(result=None, progress=None, traces=empty)
        self._refresh()

    def _refresh(self) -> None:
        allowed = frozenset() if self._asked else self._allowed()
        self._change(
            guidance=guide(self._situation()),
            allowed=allowed,
            primary=self._comes_next(allowed),
            connected=self._engine is not None,
            choices=replace(self.state.choices, editable=self._engine not in RECORDING and not self._asked),
        )

    def _allowed(self) -> frozenset[Action]:
        if self._engine in RECORDING:
            return frozenset({Action.STOP})
        arm = {Action.ARM} if self._engine is PullbackState.IDLE else set()
        leave = {Action.NEXT} if self._after is not None else set()
        return frozenset(arm | leave)

    def _comes_next(self, allowed: frozenset[Action]) -> Action | None:
        action = {None: Action.ARM, Stage.DONE: Action.NEXT}.get(self._after)
        return action if action in allowed else None

    @property
    def _where(self) -> Where:
        return self._after or self._engine or Stage.OFFLINE

    def _situation(self) -> Situation:
        gauge = self._bench.gauges.relative
        table_m, relative_m = (float(value) for value in self._live.newest_m() + self._live.zero_m)
        return Situation(
            where=self._where,
            standing=self._standing,
            table_m=table_m,
            plate_m=relative_m + table_m if gauge.measures == "plate" else relative_m,
            room=None if gauge.range_m is None else plate_room(gauge.range_m, self._excursion()),
            simulated=self._simulated,
            note=self._note,
            waiting_for=self._waiting_for,
        )

    def _excursion(self) -> Excursion:
        return usual_excursion(self._pullback_m())

    def _pullback_m(self) -> float:
        return self._bench.stand.series(self.state.choices.series).pullback_m

    def _run_settings(self) -> RunSettings:
        choices = self.state.choices
        return RunSettings(
            directory=str(self._bench.directory),
            series=choices.series,
            operator=choices.operator,
            note=choices.note,
        )

    def _new_watches(self) -> tuple[GaugeWatch, GaugeWatch]:
        gauges = self._bench.gauges
        return GaugeWatch("Gauge 1", 0, gauges.table), GaugeWatch("Gauge 2", 1, gauges.relative)

    def _header(self, **changes: object) -> None:
        self._change(header=replace(self.state.header, **changes))  # type: ignore[arg-type]

    def _choose(self, **changes: object) -> None:
        self._change(choices=replace(self.state.choices, **changes))  # type: ignore[arg-type]
