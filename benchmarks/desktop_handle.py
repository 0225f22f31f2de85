"""From a drag of the f_d handle on Identify to the new curve painted: `python benchmarks/desktop_handle.py`.

The screen with its presenter and worker stands in a window of 1280 x 800, offscreen unless
QT_QPA_PLATFORM says otherwise (`QT_QPA_PLATFORM=xcb xvfb-run` for a window system), and shows a simulated
pullback of 20 s with noise. Each drag ends when the plots have been painted with the curve of that very
f_d. Beside it, in the same run: the whole record and simulation handed to a plain pyqtgraph plot, painted.
Processor time is that of the window's thread: on a busy machine the rest is waiting for a processor.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

import pyqtgraph as pg
from PySide6.QtCore import QEvent, QObject, QTimer
from PySide6.QtWidgets import QApplication, QWidget

from analysis.motion.two_mass import TwoMassParameters
from app.presenters.analysis_task import analyse_run
from app.presenters.identify.presenter import IdentifyPresenter
from app.presenters.identify.report import ReportPresenter
from app.presenters.worker import Worker
from app.qt.identify.screen import IdentifyScreen
from app.qt.theme import Theme
from app.runs.reader import open_run
from app.runs.simulated import write_simulated_run

SECONDS, NOISE_M = 20.0, 20e-6
WARM = 20
PATIENCE_S = 120.0
TICK_MS = 16
"""Of the window, as in `app.qt.window`."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drags", type=int, default=400)
    parser.add_argument("--rate", type=float, default=1000.0, help="Hz of the record")
    options = parser.parse_args()
    app = QApplication(sys.argv[:1])
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "run.h5"
        store(path, options.rate)
        stage = Stage(app, path)
        try:
            drags_ms = stage.drag(options.drags)
            plain_ms = plain(app, path, options.drags // 4)
        finally:
            stage.close()
    what = f"{app.platformName()}, {options.rate:g} Hz x {SECONDS:g} s"
    print(f"| {what} | p50, ms | p90 | p99 | largest | processor time: p50 | p99 |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    print(row("drag to new curve painted", drags_ms))
    print(row("plain setData of the whole record and curve", plain_ms))


class Stage:
    """The screen with its presenter and a worker, as the window brings them together."""

    def __init__(self, app: QApplication, path: Path) -> None:
        self._app = app
        self._worker = Worker()
        self.presenter = IdentifyPresenter(self._worker, ReportPresenter(Worker()))
        self.screen = IdentifyScreen(Theme(app), self.presenter, lambda: None)
        self.screen.resize(1208, 800)
        self.presenter.attach(self.screen)
        self.screen.show()
        self._tick = QTimer()
        self._tick.timeout.connect(self._worker.poll)
        self._tick.start(TICK_MS)
        self.presenter.on_opening(str(path))
        self._worker.submit(
            analyse_run, str(path), done=self.presenter.on_analysed, progress=lambda _progress: None
        )
        wait(app, lambda: bool(self.presenter.state.classical), "the run is analysed")

    def drag(self, count: int) -> np.ndarray:
        """Milliseconds of each drag, and of processor time, (n, 2); the handle goes to and fro."""
        scan = self.presenter.state.scan
        if scan is None:
            raise SystemExit("the run has no scan")
        painted = Painted(self.screen._plots.curves._stack._canvas.viewport())
        handle = self.screen._scan._handle
        phase = np.linspace(0.0, 6.0 * np.pi, count + WARM)
        low, high = float(scan.friction[0]), float(scan.friction[-1])
        times_ms = []
        for friction in low + (high - low) * (0.5 + 0.49 * np.sin(phase)):
            began = Clock()
            handle.setValue(friction)
            handle.sigDragged.emit(handle)
            self._until_painted(float(handle.value()), painted)
            times_ms.append(began.since_ms())
            settle(self._app)
        return np.array(times_ms[WARM:])

    def close(self) -> None:
        """End worker and screen."""
        self._tick.stop()
        self._worker.close()
        self.screen.close()

    def _until_painted(self, friction: float, painted: "Painted") -> None:
        wait(self._app, lambda: self._has(friction), "the simulation has come")
        painted.count = 0
        wait(self._app, lambda: painted.count > 0, "the curve is painted")

    def _has(self, friction: float) -> bool:
        hand = self.presenter.state.manual_fit
        return hand is not None and hand.friction == friction


class Clock:
    """Time and processor time of this thread from now on."""

    def __init__(self) -> None:
        self._wall_s, self._busy_s = time.perf_counter(), time.thread_time()

    def since_ms(self) -> tuple[float, float]:
        """Both in milliseconds."""
        return (time.perf_counter() - self._wall_s) * 1e3, (time.thread_time() - self._busy_s) * 1e3


class Painted(QObject):
    """Counts how often a widget has been painted."""

    def __init__(self, widget: QWidget) -> None:
        super().__init__(widget)
        self.count = 0
        widget.installEventFilter(self)

    def eventFilter(self, _watched: QObject, event: QEvent) -> bool:  # noqa: N802
        """Count, and let the widget paint."""
        self.count += event.type() is QEvent.Type.Paint
        return False


def plain(app: QApplication, path: Path, count: int) -> np.ndarray:
    """The same (n, 2) for handing all points of both channels, record and curve, to pyqtgraph."""
    run = open_run(path)
    plots = pg.GraphicsLayoutWidget()
    plots.resize(800, 800)
    lines = []
    for values in (run.table_reading, run.relative_reading):
        plot = plots.addPlot()
        plots.nextRow()
        lines.append((plot.plot(pen="b"), plot.plot(pen="r"), values))
    plots.show()
    painted = Painted(plots.viewport())
    times_ms = []
    for number in range(count):
        began = Clock()
        for record, curve, values in lines:
            record.setData(run.time_s, values)
            curve.setData(run.time_s, values * (1.0 + 1e-3 * number))
        painted.count = 0
        wait(app, lambda: painted.count > 0, "the plain plot is painted")
        times_ms.append(began.since_ms())
        settle(app)
    plots.close()
    return np.array(times_ms)


def store(path: Path, rate_hz: float) -> None:
    """A pullback of the paper's stand with noise of the gauges."""
    parameters = TwoMassParameters.from_free_decay(
        period_s=0.32,
        damping_n1_per_s=0.12,
        table_mass_kg=131.6,
        plate_mass_kg=22.4,
        friction_dynamic=0.1,
        pullback_m=0.012,
    )
    write_simulated_run(
        path, Noisy(parameters.simulate(SECONDS)), parameters, series="1FFM0", rate_hz=rate_hz
    )


class Noisy:
    """A motion whose displacements are read with noise."""

    def __init__(self, motion: object) -> None:
        self._motion = motion

    def __getattr__(self, name: str) -> object:
        return getattr(self._motion, name)

    def sample_displacements(self, times_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As those of the motion."""
        table, relative = self._motion.sample_displacements(times_s)
        noise = np.random.default_rng(0).normal(scale=NOISE_M, size=(2, len(times_s)))
        return table + noise[0], relative + noise[1]


def wait(app: QApplication, condition: Callable[[], bool], what: str) -> None:
    deadline = time.perf_counter() + PATIENCE_S
    while not condition():
        if time.perf_counter() > deadline:
            raise SystemExit(f"waited {PATIENCE_S:g} s in vain until {what}")
        app.processEvents()
        time.sleep(1e-4)


def settle(app: QApplication) -> None:
    """Let everything else be painted before the next drag."""
    for _ in range(3):
        app.processEvents()
    time.sleep(0.004)


def row(name: str, times_ms: np.ndarray) -> str:
    wall_ms, busy_ms = times_ms.T
    figures = [*np.percentile(wall_ms, [50, 90, 99]), wall_ms.max(), *np.percentile(busy_ms, [50, 99])]
    return f"| {name} | {' | '.join(f'{figure:.1f}' for figure in figures)} |"


if __name__ == "__main__":
    main()
