"""Pictures of every screen with real content: `python -m tools.screenshots FOLDER`.

A pullback is recorded from the simulated stand meanwhile, one of a stand that is not ideal and a campaign are
simulated, so it takes some minutes. Each moment is drawn in both themes and each size, without a window
system. `QT_SCALE_FACTOR=2` doubles the pixels of each.
"""

import argparse
import datetime
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QCursor
from PySide6.QtWidgets import QApplication, QDialog

from analysis.health_grade import HealthGrade
from analysis.laws.stand_parts import stand_displacements
from analysis.synthetic import Truth, simulate_readings
from app.presenters.base import Tone
from app.presenters.composition import make_window_presenter
from app.presenters.gauge_health_state import GaugeHealthState
from app.presenters.gauges.state import GaugesTab
from app.presenters.identify.state import PlotTab as IdentifySide
from app.presenters.record.state import Action, PlanEdited, RunForm, StepStatus
from app.presenters.screens import Screen
from app.presenters.window import WindowPresenter
from app.qt.theme import Theme
from app.qt.window import MainWindow
from app.runs.metadata import create_metadata
from app.runs.simulated import store_motion
from app.simulated_stand.options import SimulatedStandOptions
from config.files import load_gauges, load_stand, settings_file
from messages.i18n import ENGLISH, gettext, languages, use_language

SIZES = ((1280, 800), (1920, 1080))
THEMES = {"light": Qt.ColorScheme.Light, "dark": Qt.ColorScheme.Dark}
_PATIENCE_S = 600.0
_BY_HAND = 0.4
"""How far towards the end of the scan the handle is drawn."""
_LAID_OVER = 3
_EFFECTS = {"release_ramp_s": 0.011, "film_s_per_m": 1.0}
Wait = Callable[[Callable[[], bool], str], None]
_PLAN = "* x3"
_FORM = RunForm(operator="N. Schwarz", temperature_c="21.5", humidity_percent="45", plate_id="P1")
# It rests long enough between two tests for the gauges to be looked at while nothing moves.
_STAND = SimulatedStandOptions(seed=1, rest_s=20.0, decay_s=30.0)


class ScreenshotError(Exception):
    """A moment that did not come."""


class Camera:
    """Draws a window in every theme and size, into files of `folder`."""

    def __init__(
        self, theme: Theme, window: MainWindow, folder: Path, sizes: Sequence[tuple[int, int]]
    ) -> None:
        self._theme = theme
        self._window = window
        self._folder = folder
        self._sizes = sizes

    def shoot(self, name: str) -> None:
        """Write `name-light-1280x800.png` and its like."""
        for theme, scheme in THEMES.items():
            self._theme.fix(scheme)
            for width, height in self._sizes:
                self._window.resize(width, height)
                QCursor.setPos(self._window.mapToGlobal(QPoint(4, height - 4)))
                QApplication.processEvents()
                self._window.grab().save(str(self._folder / f"{name}-{theme}-{width}x{height}.png"))

    def shoot_dialog(self, name: str, kind: type[QDialog]) -> None:
        """Write `name-light.png` and its like of an open dialog, and close it."""
        dialog = self._window.findChild(kind)
        if dialog is None:
            raise ScreenshotError(f"{name}: no such dialog is open")
        for theme, scheme in THEMES.items():
            self._theme.fix(scheme)
            QApplication.processEvents()
            dialog.grab().save(str(self._folder / f"{name}-{theme}.png"))
        dialog.close()


def take_all(folder: Path, sizes: Sequence[tuple[int, int]] = SIZES) -> None:
    """Record a pullback from the simulated stand, and draw each screen on the way. Raises ScreenshotError."""
    folder.mkdir(parents=True, exist_ok=True)
    app = QApplication.instance() or QApplication(sys.argv[:1])
    if not isinstance(app, QApplication):
        raise ScreenshotError("a Qt application without widgets runs already: end it first")
    presenter = make_window_presenter(_STAND)
    theme = Theme(app)
    window = MainWindow(theme, presenter)
    window.show()
    camera = Camera(theme, window, folder, sizes)
    try:
        _play(presenter, camera)
        _shoot_dialogs(window, presenter, camera)
    finally:
        window.close()


def _play(presenter: WindowPresenter, camera: Camera) -> None:
    record = presenter.record
    camera.shoot("start")
    presenter.warm_up()
    presenter.open_simulated(_STAND.series)
    wait = _Patience(presenter).wait
    wait(lambda: record.state.primary is Action.ARM, "the simulated stand is there")
    record.count_simulated(True)
    record.dispatch(PlanEdited(_PLAN))
    record.dispatch(_FORM)
    record.dispatch(Action.ARM)
    wait(lambda: _pulled_mm(presenter) > 8.0, "the table is pulled back")
    camera.shoot("record-pull")
    wait(lambda: _step(presenter) == gettext("Slip") and _drawn_s(presenter) > 2.0, "the plate slips")
    camera.shoot("record-slip")
    wait(lambda: record.state.result is not None, "the friction is found")
    camera.shoot("record-result")
    record.dispatch(Action.NEXT)
    wait(lambda: record.state.plan.done == 1, "the run is kept and counted")
    camera.shoot("record-kept")
    _shoot_identify(presenter, camera, wait)
    _shoot_stand(presenter, camera, wait)
    _shoot_campaign(presenter, camera, wait)
    _shoot_runs(presenter, camera, wait)
    presenter.show_screen(Screen.GAUGES)
    wait(lambda: _are_sound(presenter.gauges.state.health), "the table rests and both gauges are good")
    camera.shoot("gauges-health")
    presenter.gauges.set_tab(GaugesTab.PORTS)
    camera.shoot("gauges-ports")
    presenter.gauges.set_tab(GaugesTab.CALIBRATE)
    camera.shoot("gauges-calibrate")
    presenter.gauges.set_tab(GaugesTab.CHECK)
    camera.shoot("gauges-check")
    presenter.show_screen(Screen.STAND)
    wait(lambda: presenter.stand.state.is_running, "the stand tells what is true")
    camera.shoot("stand")


def _shoot_dialogs(window: MainWindow, presenter: WindowPresenter, camera: Camera) -> None:
    """Settings, an export, the keys, and an import: the run drawn on Runs as the file of another program."""
    from app.qt.runs.export_dialog import ExportDialog
    from app.qt.runs.import_dialog import ImportDialog
    from app.qt.widgets.shortcuts import HelpDialog

    presenter.show_screen(Screen.SETTINGS)
    camera.shoot("settings")
    presenter.show_screen(Screen.RUNS)
    window.ask_for_export()
    camera.shoot_dialog("export", ExportDialog)
    window.show_help()
    camera.shoot_dialog("keys", HelpDialog)
    overlay = presenter.runs.state.overlay
    if overlay is None or overlay.traces[0].relative is None:
        raise ScreenshotError("no run with two gauges is drawn on Runs: nothing can be imported")
    (trace, *_) = overlay.traces
    file = Path(presenter.runs.state.folder) / "logger.csv"
    columns = (trace.time_s, trace.table, overlay.traces[0].relative)
    lines = zip(*(column[::2] for column in columns), strict=True)  # each time stands there twice
    rows = (f"{time_s:.4f};{table:.4f};{relative:.4f}".replace(".", ",") for time_s, table, relative in lines)
    file.write_text("\n".join(["t (s);u1 (mm);u2-u1 (mm)", *rows]), encoding="utf-8")
    presenter.runs.add_files((str(file),))
    window.show_import()
    importing = presenter.runs.import_dialog
    _Patience(presenter).wait(lambda: importing.state.can_import, "the file is read")
    camera.shoot_dialog("import", ImportDialog)


def _shoot_identify(presenter: WindowPresenter, camera: Camera, wait: Wait) -> None:
    identify = presenter.identify
    presenter.show_screen(Screen.IDENTIFY)
    wait(lambda: bool(identify.state.classical), "the classical figures are worked out")
    camera.shoot("identify")
    scan = identify.state.scan
    if scan is not None:
        identify.set_friction(scan.fitted + _BY_HAND * (float(scan.friction[-1]) - scan.fitted))
        wait(lambda: identify.state.manual_fit is not None, "the motion by hand is simulated")
        camera.shoot("identify-hand")
        identify.reset_friction()
    identify.toggle_cursors()
    camera.shoot("identify-cursors")
    identify.toggle_cursors()
    identify.set_tab(IdentifySide.RELATIVE)
    camera.shoot("identify-relative")
    identify.set_tab(IdentifySide.DISPLACEMENT)


def _shoot_stand(presenter: WindowPresenter, camera: Camera, wait: Wait) -> None:
    """A run of a stand that releases slowly and has a viscous film: its verdict, and friction by slip."""
    truth = Truth(friction_static=0.12, tilt_rad=1e-3)
    motion = stand_displacements(truth.parameters(), _EFFECTS, truth.duration_s + 1e-3)
    _, table, relative = simulate_readings(truth, motion)
    now = datetime.datetime.now().astimezone()
    metadata = create_metadata(
        load_stand(), load_gauges(), now, series="1FFM0", rate_hz=truth.rate_hz, source="simulated"
    )
    # Apart from the recorded run, so that Campaign does not pool both.
    path = Path(presenter.runs.state.folder).parent / "real-stand" / "slow-release.h5"
    path.parent.mkdir(parents=True, exist_ok=True)
    readings = np.column_stack([table, relative])
    store_motion(path, metadata, readings, release_s=truth.hold_s, rate_hz=truth.rate_hz)
    identify = presenter.identify
    presenter.open_run(str(path))
    wait(lambda: bool(identify.state.classical), "the stand is identified")
    camera.shoot("identify-stand")
    identify.set_tab(IdentifySide.FRICTION)
    camera.shoot("identify-slips")
    identify.set_tab(IdentifySide.DISPLACEMENT)


def _shoot_campaign(presenter: WindowPresenter, camera: Camera, wait: Wait) -> None:
    """All series of Table 1, simulated: the longest part."""
    campaign = presenter.campaign
    presenter.show_screen(Screen.CAMPAIGN)
    wait(lambda: campaign.state.is_gathered, "the run is gathered")
    camera.shoot("campaign-first-run")
    campaign.simulate_campaign()
    wait(lambda: campaign.state.summary.series_count > 1, "a whole campaign is simulated and gathered")
    camera.shoot("campaign")
    campaign.save_results()
    wait(lambda: not campaign.state.summary.unsaved_count, "the results are kept")
    campaign.select_series(campaign.state.summary.rows[0].label)
    camera.shoot("campaign-series")


def _shoot_runs(presenter: WindowPresenter, camera: Camera, wait: Wait) -> None:
    runs = presenter.runs
    presenter.show_screen(Screen.RUNS)
    wait(lambda: len(runs.state.rows) > _LAID_OVER, "the runs are listed")
    runs.select(tuple(row.path for row in runs.state.rows[:_LAID_OVER]))
    wait(lambda: runs.state.overlay is not None, "the runs are drawn")
    camera.shoot("runs")


def _are_sound(health: tuple[GaugeHealthState, ...]) -> bool:
    return bool(health) and all(gauge.verdict is HealthGrade.GOOD for gauge in health)


def _pulled_mm(presenter: WindowPresenter) -> float:
    target = presenter.record.state.guidance.target
    return target.now_mm if target else 0.0


def _step(presenter: WindowPresenter) -> str:
    steps = presenter.record.state.guidance.steps
    return next((step.name for step in steps if step.status is StepStatus.NOW), "")


def _drawn_s(presenter: WindowPresenter) -> float:
    time_s = presenter.record.state.traces.table.time_s
    return float(time_s[-1]) if len(time_s) else 0.0


class _Patience:
    """Waits for moments, as long as nothing goes wrong."""

    def __init__(self, presenter: WindowPresenter) -> None:
        self._presenter = presenter

    def wait(self, condition: Callable[[], bool], what: str) -> None:
        """Keep the window alive until `condition` holds. Raises ScreenshotError."""
        deadline = time.perf_counter() + _PATIENCE_S
        while not condition():
            notice = self._presenter.state.notice
            if notice is not None and notice.tone is Tone.BAD:  # a busy computer is warned of, no more
                raise ScreenshotError(notice.text)
            if time.perf_counter() > deadline:
                raise ScreenshotError(f"waited {_PATIENCE_S:g} s in vain until {what}. Try again")
            QApplication.processEvents()
            time.sleep(0.005)


def _size(text: str) -> tuple[int, int]:
    width, height = text.split("x")
    return int(width), int(height)


def main() -> int:
    """Return the exit code: 1 if a picture could not be taken."""
    parser = argparse.ArgumentParser(prog="python -m tools.screenshots", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--language", choices=languages(), default=ENGLISH)
    parser.add_argument("--size", type=_size, action="append", metavar="WIDTHxHEIGHT", help="may be repeated")
    options = parser.parse_args()
    use_language(options.language)
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    with tempfile.TemporaryDirectory(prefix="slipstand-") as recordings:
        os.environ["SLIPSTAND_RECORDINGS"] = str(Path(recordings) / "recordings")
        settings = Path(recordings) / "settings"  # nobody's own
        settings.mkdir()
        for name in ("stand.toml", "gauges.toml"):
            shutil.copy(settings_file(name), settings)
        os.environ["SLIPSTAND_CONFIG"] = str(settings)
        try:
            take_all(options.folder, options.size or SIZES)
        except ScreenshotError as error:
            sys.stderr.write(f"error: {error}\n")
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
