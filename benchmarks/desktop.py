"""The window against its figures: repaint, an hour in view, zoom and pan, wire to screen, start, memory.

`python benchmarks/desktop.py [--frames 600] [--seconds 20] [--starts 5]` prints the lines of
docs/benchmarks.md. It draws without a window system unless QT_QPA_PLATFORM says otherwise; under Xvfb:
`QT_QPA_PLATFORM=xcb xvfb-run -s "-screen 0 1920x1080x24" python benchmarks/desktop.py`. Memory is read from
/proc (Linux). What a frame takes is the time from the new samples to the end of the paint event.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

import pyqtgraph as pg
from PySide6.QtCore import QEvent, QEventLoop, QPoint, QPointF, Qt
from PySide6.QtGui import QMouseEvent, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget

from app.acquisition.messages import PullbackState, StandPosition
from app.acquisition.ring import RingRows
from app.presenters.composition import make_window_presenter
from app.presenters.identify.state import ChannelCurves, Curves, ReadingUnit
from app.presenters.record.live import LiveTraces
from app.presenters.record.state import Action
from app.presenters.screens import Screen
from app.qt import main as desktop
from app.qt.identify.curve_plots import CurvePlots
from app.qt.record.live_plots import LivePlots
from app.qt.theme import Theme
from app.qt.window import MainWindow
from app.simulated_stand.options import SimulatedStandOptions
from config.files import load_gauges

RATE_HZ = 2000.0
HOUR_S = 3600.0
FRAMES_HZ = 60.0
SIZE = (1920, 1080)
PULLBACK_M = 0.012
RELEASED_S = 1.0
PLAIN_FRAMES = 5
PAN_FRAMES = 100
BETWEEN_MOVES_S = 0.011
"""pyqtgraph takes 100 moves of the mouse a second."""

STARTER = """
import sys, time
from PySide6.QtCore import QEvent, QObject, QTimer
from PySide6.QtWidgets import QApplication, QWidget
import app.qt.main as desktop

class Painted(QObject):
    def eventFilter(self, watched, event):
        if event.type() is QEvent.Type.Paint and isinstance(watched, QWidget) and watched.isWindow():
            QApplication.instance().removeEventFilter(self)
            QTimer.singleShot(0, self.tell)
        return False

    def tell(self):
        print(time.monotonic(), time.process_time(), flush=True)
        QApplication.instance().topLevelWidgets()[0].close()
        QApplication.instance().quit()

run = desktop._run

def watched(application, window, presenter, simulated):
    painted = Painted(application)
    application.installEventFilter(painted)
    return run(application, window, presenter, simulated)

desktop._run = watched
sys.argv = ["slipstand"]
from app.__main__ import main
main()
"""


@dataclass
class Frames:
    """What the paint events of all plots say: when each ended, how long it took."""

    ended_s: list[float] = field(default_factory=list)
    took_s: list[float] = field(default_factory=list)

    def watch(self) -> None:
        """Note every paint event of plots that are made from now on."""
        paint = pg.GraphicsView.paintEvent

        def timed(view: pg.GraphicsView, event: object) -> None:
            began = time.perf_counter()
            paint(view, event)
            ended = time.perf_counter()
            self.ended_s.append(time.time())
            self.took_s.append(ended - began)

        pg.GraphicsView.paintEvent = timed

    def clear(self) -> None:
        """Forget what was painted."""
        self.ended_s.clear()
        self.took_s.clear()

    def check(self, count: int) -> None:
        """Refuse times of frames that were not painted."""
        if len(self.ended_s) < count:
            raise SystemExit(f"error: only {len(self.ended_s)} of {count} frames were painted")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=600)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--starts", type=int, default=5)
    chosen = parser.parse_args()
    print(f"load {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores, {os.environ['QT_QPA_PLATFORM']}")
    starts(chosen.starts)
    with tempfile.TemporaryDirectory() as folder:
        os.environ["SLIPSTAND_RECORDINGS"] = folder
        os.environ["SLIPSTAND_CONFIG"] = folder
        app = QApplication(sys.argv[:1])
        theme, frames = Theme(app), Frames()
        frames.watch()
        hour_in_view(app, theme, frames, chosen.frames)
        zoom_and_pan(app, theme, frames, chosen.frames)
        plain(app, frames)
        wire_to_screen(app, theme, frames, chosen.seconds)


def starts(count: int) -> None:
    """From the start of the process to the first painted window, and to its end."""
    wall, processor = [], []
    with tempfile.TemporaryDirectory() as folder:
        places = {"SLIPSTAND_RECORDINGS": folder, "SLIPSTAND_CONFIG": folder}
        for _ in range(count):
            began = time.monotonic()
            told = subprocess.run(
                [sys.executable, "-c", STARTER],
                env=os.environ | places,
                capture_output=True,
                text=True,
                check=True,
            ).stdout.split()
            wall.append(float(told[0]) - began)
            processor.append(float(told[1]))
    print(
        f"start to painted window: {np.median(wall):.2f} s in the middle, {max(wall):.2f} s at most"
        f" of {count}; processor {np.median(processor):.2f} s"
    )


def hour_in_view(app: QApplication, theme: Theme, frames: Frames, count: int) -> None:
    """An hour at 2 kHz on the live plots, 1/60 s more with each frame."""
    traces = replace(LiveTraces.of_gauges(load_gauges()), width_px=SIZE[0])
    plots = LivePlots(theme)
    plots.resize(*SIZE)
    plots.show()
    before_kb = memory_kb()
    feed(traces, 0.0, RELEASED_S)
    traces = traces.on_state(PullbackState.RELEASED, RELEASED_S, StandPosition())
    for second in np.arange(RELEASED_S, HOUR_S - 60.0, 0.5):
        feed(traces, float(second), 0.5)
    after_kb = memory_kb()
    traces = traces.cleared(PULLBACK_M)
    plots.show_traces(traces.traces)
    app.processEvents()
    now_s, took = traces.samples.end_s, []
    frames.clear()
    for _ in range(count):
        began = time.perf_counter()
        traces = traces.with_rows(rows(now_s, 1.0 / FRAMES_HZ), PULLBACK_M, None)
        plots.show_traces(traces.traces)
        repaint(plots)
        took.append(time.perf_counter() - began)
        now_s = traces.samples.end_s
    tell(f"hour at {RATE_HZ:g} Hz in view, {SIZE[0]} x {SIZE[1]}", took)
    frames.check(count)
    grown_kb = memory_kb() - after_kb
    print(
        f"memory: {(after_kb - before_kb) / 1024:+.1f} MB in the hour,"
        f" {grown_kb / 1024:+.1f} MB in the frames"
    )
    plots.close()


def zoom_and_pan(app: QApplication, theme: Theme, frames: Frames, count: int) -> None:
    """An hour at 2 kHz on Record and on Identify: from an event of wheel or mouse to the painted frame."""
    live, traces = LivePlots(theme), hour_of_traces()
    live.show_traces(traces.traces)
    live.zoomed.connect(lambda span: live.show_traces(traces.zoomed(span).traces))
    fitted = CurvePlots(theme)
    fitted.show_curves(hour_of_curves())
    for name, plots in (("Record", live), ("Identify", fitted)):
        plots.resize(*SIZE)
        plots.show()
        QTest.qWaitForWindowExposed(plots)  # without, X may not have it yet and nothing is painted
        app.processEvents()
        plots._stack.reset_view()
        desktop.exempt_from_collection()  # as the window does two seconds after its start
        (view,) = plots.findChildren(pg.GraphicsView)
        for what, gesture in (("zoom", zoom), ("pan", pan)):
            frames.clear()
            took, busy = [], []
            for number in range(count):
                if gesture is pan and number % PAN_FRAMES == 0:
                    begin_pan(view.viewport(), number // PAN_FRAMES)
                wait_busily(BETWEEN_MOVES_S)
                began, began_busy = time.perf_counter(), time.thread_time()
                gesture(view.viewport(), number)
                view.viewport().repaint()
                took.append(time.perf_counter() - began)
                busy.append(time.thread_time() - began_busy)
            frames.check(count)
            tell(f"{what}, hour at {RATE_HZ:g} Hz on {name}, {SIZE[0]} x {SIZE[1]}", took)
            tell("  of which processor time", busy)
        plots.close()


def wait_busily(seconds: float) -> None:
    """Wait without giving the processor away: a virtual one that was idle works more slowly for some time."""
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        pass


def zoom(viewport: QWidget, number: int) -> None:
    """Turn the wheel: 40 steps in, to a second of the hour, and 40 out again, at places side by side."""
    steps = 40
    is_in = number // steps % 2 == 0
    at = QPointF(viewport.width() * (0.2 + 0.6 * (number // (2 * steps) % 7) / 6.0), viewport.height() / 4.0)
    angle = QPoint(0, 120 if is_in else -120)
    nothing, no_keys = Qt.MouseButton.NoButton, Qt.KeyboardModifier.NoModifier
    event = QWheelEvent(
        at, viewport.mapToGlobal(at), QPoint(), angle, nothing, no_keys, Qt.ScrollPhase.NoScrollPhase, False
    )
    QApplication.sendEvent(viewport, event)


def begin_pan(viewport: QWidget, turn: int) -> None:
    """Zoom in ten steps further, at each fourth turn all out, and press the middle button."""
    middle = Qt.MouseButton.MiddleButton
    if turn:
        send_mouse(
            viewport, QEvent.Type.MouseButtonRelease, pan_place(viewport, 0), middle, Qt.MouseButton.NoButton
        )
    for step in range(40 if turn % 4 == 3 else 10):
        zoom(viewport, 40 if turn % 4 == 3 else step)
    viewport.repaint()
    send_mouse(viewport, QEvent.Type.MouseButtonPress, pan_place(viewport, 0), middle, middle)


def pan(viewport: QWidget, number: int) -> None:
    """Drag by the middle button, some pixels a frame, to and fro."""
    at = pan_place(viewport, number % PAN_FRAMES)
    send_mouse(viewport, QEvent.Type.MouseMove, at, Qt.MouseButton.NoButton, Qt.MouseButton.MiddleButton)


def pan_place(viewport: QWidget, frame: int) -> QPointF:
    return QPointF(viewport.width() / 2.0 + 8.0 * abs(frame - PAN_FRAMES // 2), viewport.height() / 4.0)


def send_mouse(
    viewport: QWidget, kind: QEvent.Type, at: QPointF, button: Qt.MouseButton, buttons: Qt.MouseButton
) -> None:
    no_keys = Qt.KeyboardModifier.NoModifier
    QApplication.sendEvent(
        viewport, QMouseEvent(kind, at, viewport.mapToGlobal(at), button, buttons, no_keys)
    )


def hour_of_traces() -> LiveTraces:
    """Live traces of an hour from the release on."""
    traces = replace(LiveTraces.of_gauges(load_gauges()), width_px=SIZE[0])
    feed(traces, 0.0, RELEASED_S)
    traces = traces.on_state(PullbackState.RELEASED, RELEASED_S, StandPosition())
    for second in np.arange(RELEASED_S, HOUR_S, 0.5):
        feed(traces, float(second), 0.5)
    return traces.stopped().cleared(PULLBACK_M)


def hour_of_curves() -> Curves:
    """Record, simulation and residual of both gauges."""
    time_s = np.arange(-RELEASED_S, HOUR_S, 1.0 / RATE_HZ)
    noise = np.random.default_rng(1).normal(scale=20.0, size=(2, len(time_s)))
    swing = 11.0 * np.cos(2.0 * np.pi / 0.32 * time_s)
    channels = tuple(
        ChannelCurves(share * swing + 1e-3 * left, share * swing, left)
        for share, left in zip((1.0, 0.5), noise, strict=True)
    )
    unit, residual_unit = ReadingUnit("mm", 3), ReadingUnit("µm", 1)
    return Curves(time_s, "time from release, s", channels, unit, residual_unit, noise=20.0)


def plain(app: QApplication, frames: Frames) -> None:
    """The same hour by `setData` of the whole record, plainly, and with what pyqtgraph offers."""
    time_s = np.arange(0.0, HOUR_S, 1.0 / RATE_HZ)
    values = [motion_m(time_s)[:, channel] for channel in range(2)]
    for name, options in (
        ("plain setData", {}),
        ("setData, downsampled and clipped by pyqtgraph", {"clipToView": True, "autoDownsample": True}),
    ):
        canvas = pg.GraphicsLayoutWidget()
        canvas.resize(*SIZE)
        curves = [canvas.addPlot(row=row, col=0).plot(pen="b", **options) for row in range(2)]
        if options:
            for curve in curves:
                curve.setDownsampling(auto=True, method="peak")
        canvas.show()
        app.processEvents()
        frames.clear()
        took = []
        for _ in range(PLAIN_FRAMES):
            began = time.perf_counter()
            for curve, value in zip(curves, values, strict=True):
                curve.setData(time_s, value)
            canvas.viewport().repaint()
            took.append(time.perf_counter() - began)
        frames.check(PLAIN_FRAMES)
        tell(name, took)
        canvas.close()


def wire_to_screen(app: QApplication, theme: Theme, frames: Frames, seconds: float) -> None:
    """A pullback of the simulated stand in the whole window: how old each sample is when it is first seen.

    The stand's own time is 0 at a moment of the host's clock, so that each sample's moment is known.
    """
    origin_s = time.time() + 4.0
    stand = SimulatedStandOptions(seed=1, rate_hz=RATE_HZ, decay_s=seconds, start_at_unix_s=origin_s)
    presenter = make_window_presenter(stand)
    window = MainWindow(theme, presenter)
    window.resize(1280, 800)
    window.show()
    presenter.open_simulated(stand.series)
    record = presenter.record
    run_until(app, lambda: record.state.primary is Action.ARM)
    record.dispatch(Action.ARM)
    frames.clear()
    before_kb, seen, end = memory_kb(), [], time.monotonic() + seconds
    shown = record.state.traces
    while time.monotonic() < end and presenter.state.screen is Screen.RECORD:
        painted = len(frames.ended_s)
        app.processEvents(QEventLoop.ProcessEventsFlag.WaitForMoreEvents)
        if len(frames.ended_s) > painted and record.state.traces is not shown:
            shown = record.state.traces
            seen.append((frames.ended_s[-1], record._model.live.samples.end_s))
    simulation = presenter._connection.stand
    started_s = origin_s + simulation.truth().wire.started_s
    grown_kb = memory_kb() - before_kb
    window.close()
    ages = ages_s(np.array(seen), started_s)
    tell("repaint of the plots during a run, 1280 x 800", frames.took_s)
    print(f"frames a second: {len(seen) / seconds:.1f} (the window asks for {1e3 / 16:.1f})")
    print(
        f"wire to screen: p50 {1e3 * np.percentile(ages, 50):.1f} ms, p99 {1e3 * np.percentile(ages, 99):.1f}"
        f" ms, at most {1e3 * ages.max():.1f} ms of {len(ages)} samples"
    )
    print(f"memory of the window: {before_kb / 1024:.0f} MB, {grown_kb / 1024:+.1f} MB in {len(seen)} frames")


def ages_s(seen: np.ndarray, started_s: float) -> np.ndarray:
    """Age of each sample when first painted; `seen` (n, 2): ends of frames and the newest times shown."""
    time_s = np.arange(round(seen[0, 1] * RATE_HZ) + 1, round(seen[-1, 1] * RATE_HZ)) / RATE_HZ
    frame = np.searchsorted(seen[:, 1], time_s)
    return seen[frame, 0] - (started_s + time_s)


def feed(traces: LiveTraces, start_s: float, length_s: float) -> None:
    """Append samples without drawing them."""
    new = rows(start_s, length_s)
    traces.samples.append(new.time_s, np.column_stack((new.table_m, new.relative_m)))


def rows(start_s: float, length_s: float) -> RingRows:
    first, count = round(start_s * RATE_HZ), round(length_s * RATE_HZ)
    time_s = (first + np.arange(count)) / RATE_HZ
    readings = motion_m(time_s)
    counts, status = np.zeros((count, 2)), np.zeros(count, np.uint8)
    return RingRows(first, counts, readings, readings[:, 1], status, time_s)


def motion_m(time_s: np.ndarray) -> np.ndarray:
    """A swing that does not die away, with noise: what is dearest to draw."""
    noise = np.random.default_rng(1).normal(scale=20e-6, size=(len(time_s), 2))
    return noise + 0.011 * np.cos(2.0 * np.pi / 0.32 * time_s)[:, None] * (1.0, 0.5)


def repaint(widget: QWidget) -> None:
    for view in widget.findChildren(pg.GraphicsView):
        view.viewport().repaint()


def run_until(app: QApplication, condition) -> None:
    end = time.monotonic() + 60.0
    while not condition():
        if time.monotonic() > end:
            raise SystemExit("error: the simulated stand did not come. Try a quieter machine")
        app.processEvents()
        time.sleep(0.005)


def tell(what: str, took_s: list[float]) -> None:
    middle, high, worst = (1e3 * np.percentile(took_s, p) for p in (50, 99, 100))
    print(f"{what}: p50 {middle:.1f} ms, p99 {high:.1f} ms, at most {worst:.1f} ms of {len(took_s)} frames")


def memory_kb() -> int:
    """Memory that is this process's own."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("RssAnon"))


if __name__ == "__main__":
    main()
