"""What is decided, planned and filled in on the Record screen, by key and by click; and what is heard."""

import io
import wave
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest
from looking import clipped_words, visible_words
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication, QLabel, QLineEdit, QPushButton
from pytestqt.qtbot import QtBot
from stage import (
    END_S,
    FakeRecorder,
    FakeWorker,
    analysed,
    bench,
    ended,
    health,
    rows_between,
    script,
    standing,
)

from app.acquisition.messages import Connected, PullbackState, StateChanged
from app.presenters.record.next_runs import SeriesProgress
from app.presenters.record.presenter import RecordPresenter
from app.presenters.record.state import (
    Connecting,
    Cue,
    KeepRun,
    LoadedPlan,
    LoadPlan,
    MoveToTrash,
    PlanState,
    RecordTask,
    RunForm,
    SavePlan,
    Step,
    StepStatus,
    TaskDone,
)
from app.qt.keyboard import KeyboardWindow
from app.qt.record import sound
from app.qt.record.panels import Stepper, TargetBar
from app.qt.record.run_bar import PlanStrip
from app.qt.record.screen import RecordScreen
from app.qt.theme import Theme
from app.runs.metadata import Conditions
from app.runs.next_tests import NextTests, PlannedSeries
from config.schema import Settings

RUN = str(analysed().path)
KEPT = NextTests(
    plan=tuple(PlannedSeries(series, 3) for series in bench().all_series),
    series="1FFM1",
    operator="N. Schwarz",
    conditions=Conditions(temperature_c=21.5, plate_id="P1"),
)


class Stage:
    """A screen at rest, with a plan."""

    def __init__(self, theme: Theme, qtbot: QtBot) -> None:
        self.qtbot = qtbot
        self.recorder = FakeRecorder()
        self.files = FakeWorker()
        self.presenter = RecordPresenter(self.recorder, bench(), self.files, "me")  # type: ignore[arg-type]
        self.screen = RecordScreen(theme, self.presenter)
        self.window = KeyboardWindow()
        self.window.setCentralWidget(self.screen)
        qtbot.addWidget(self.window)
        self.window.resize(1188, 800)
        self.presenter.attach(self.screen)
        self.window.show()
        self.window.activateWindow()
        qtbot.waitUntil(self.window.isActiveWindow)
        self.presenter.dispatch(Connecting("COM7"))
        done = (("/a", "1FFM0"), ("/b", "1FFM0"), ("/c", "1FFM0"), ("/d", "1FFM1"))
        self.answer(LoadPlan("/recordings"), LoadedPlan(KEPT, done))
        self.presenter.dispatch(Connected("GSV-8 S/N 1234", "1", 1000.0, "/ring"))
        self.presenter.dispatch(StateChanged(PullbackState.IDLE, 0.0))
        self.presenter.dispatch(health(bytes_per_s=70_000.0))
        self.presenter.tick()
        self.tasks()

    def answer(self, task: RecordTask, answer: object) -> None:
        self.presenter.dispatch(TaskDone(task, answer))
        self.presenter.tick()

    def tasks(self) -> list[RecordTask]:
        """Tasks since the last call, without those that store the plan."""
        asked = [call.arguments[0] for call in self.files.calls]
        self.files.calls.clear()
        return [task for task in asked if not isinstance(task, SavePlan)]

    def record(self) -> None:
        """Up to the result."""
        self.press(Qt.Key.Key_A)
        for _, event in script(RUN):
            self.presenter.dispatch(event)
        self.recorder.rows = rows_between(0.0, END_S)
        self.presenter.tick()
        self.tasks()
        self.presenter.dispatch(analysed())

    def press(self, key: Qt.Key, modifier: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier) -> None:
        self.qtbot.keyClick(self.screen, key, modifier)

    def button(self, text: str) -> QPushButton:
        (found,) = [
            b for b in self.screen.findChildren(QPushButton) if b.text().startswith(text) and b.isVisible()
        ]
        return found

    def field(self, name: str) -> QLineEdit:
        (found,) = [f for f in self.screen.findChildren(QLineEdit) if f.accessibleName() == name]
        return found

    def words(self) -> str:
        return visible_words(self.screen)


@pytest.fixture
def stage(theme: Theme, qtbot: QtBot) -> Stage:
    return Stage(theme, qtbot)


@pytest.mark.parametrize("width", [932, 1188, 1828])
def test_no_word_is_cut_off_where_a_run_is_decided_about(stage: Stage, width: int) -> None:
    stage.screen.resize(width, 700)
    stage.record()
    stage.press(Qt.Key.Key_F2)
    for _ in range(3):  # numbers that fit their column change its layout
        QApplication.processEvents()
    assert clipped_words(stage.screen) == []


def test_a_long_header_is_cut_short_by_its_names_alone(stage: Stage) -> None:
    stage.screen.resize(932, 700)
    stage.presenter.dispatch(RunForm(count="12"))
    stage.press(Qt.Key.Key_A)
    stage.presenter.dispatch(Connected("GSV-8 S/N 1234 at the second bench", "1", 1000.0, "/ring"))
    stage.presenter.dispatch(health(missing=123_456, free_disk_bytes=90_000_000, bytes_per_s=70_000.0))
    stage.presenter.dispatch(StateChanged(PullbackState.ZERO, 1.0))
    stage.recorder.rows = rows_between(0.0, 0.5)
    stage.presenter.tick()
    QApplication.processEvents()
    assert clipped_words(stage.screen) == []
    assert stage.screen.width() == 932
    words = stage.words()
    assert "GSV-8 S/N 1234 at the second bench" not in words
    for whole in ("▲ Lost 123456", "■ Disk nearly full: 90\u202fMB free, 21\u202fmin", "1000.02\u202fHz"):
        assert whole in words
    stage.screen.resize(1828, 700)
    QApplication.processEvents()
    assert "GSV-8 S/N 1234 at the second bench" in stage.words()


def test_the_decision_is_asked_with_large_buttons(stage: Stage) -> None:
    assert "Repeat" not in stage.words()
    stage.record()
    assert {stage.button(text).height() for text in ("Repeat", "Discard")} == {56}
    assert stage.button("Repeat").toolTip().endswith("(R)")
    assert stage.button("Discard").toolTip().startswith("Move the run to the trash")


def test_enter_keeps_with_the_note_that_was_typed(stage: Stage) -> None:
    stage.record()
    note = stage.field("Note on this run")
    note.setFocus()
    stage.qtbot.keyClicks(note, "rather dark")
    assert stage.tasks() == [], "letters in a field decide nothing"
    stage.qtbot.keyClick(note, Qt.Key.Key_Return)
    (kept,) = stage.tasks()
    assert isinstance(kept, KeepRun)
    assert kept.note == "rather dark"
    assert "Repeat" not in stage.words()


@pytest.mark.parametrize(("key", "armed"), [(Qt.Key.Key_R, 2), (Qt.Key.Key_D, 1), (Qt.Key.Key_Delete, 1)])
def test_single_keys_put_a_run_aside_and_ctrl_z_brings_it_back(stage: Stage, key: Qt.Key, armed: int) -> None:
    stage.record()
    stage.press(key)
    (aside,) = stage.tasks()
    assert aside == MoveToTrash(RUN, "me")
    assert len(stage.recorder.armed) == armed
    stage.answer(aside, "/recordings/.trash/20260112_1FFM0_001.h5")
    assert "▲ Moved 20260112_1FFM0_001 to the trash" in stage.words()
    stage.tasks()
    stage.press(Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert [type(task).__name__ for task in stage.tasks()] == ["RestoreFromTrash"]


def test_enter_presses_the_button_that_has_the_focus(stage: Stage) -> None:
    stage.record()
    discard = stage.button("Discard")
    discard.setFocus()
    stage.qtbot.keyClick(discard, Qt.Key.Key_Return)
    assert stage.tasks() == [MoveToTrash(RUN, "me")]


def test_the_focus_is_on_what_comes_next_and_never_slips_into_a_field(stage: Stage) -> None:
    stage.press(Qt.Key.Key_F2)
    stage.button("Arm").setFocus()
    stage.record()
    focused = QApplication.focusWidget()
    assert isinstance(focused, QPushButton)
    assert focused.text() == "Keep\nEnter"
    stage.qtbot.keyClick(focused, Qt.Key.Key_Return)
    assert [type(task) for task in stage.tasks()] == [KeepRun]
    assert QApplication.focusWidget() is stage.screen, "no button is pressed by mistake"


def test_one_button_alone_is_brought_out_while_a_run_is_decided_about(stage: Stage) -> None:
    stage.record()
    shown = [b for b in stage.screen.findChildren(QPushButton) if b.isVisible()]
    assert [b.text() for b in shown if b.property("primary") == "true"] == ["Keep\nEnter"]


def test_keep_is_said_once_and_no_button_moves_meanwhile(stage: Stage) -> None:
    places = {text: stage.button(text).pos() for text in ("Tare   T", "Arm   A", "Stop   Esc")}
    stage.record()
    shown = [button.text() for button in stage.screen.findChildren(QPushButton) if button.isVisible()]
    assert [text for text in shown if "Enter" in text] == ["Keep\nEnter"]
    assert places == {text: stage.button(text).pos() for text in places}


def test_n_writes_a_note_and_escape_leaves_it_to_the_single_keys(stage: Stage) -> None:
    stage.record()
    stage.press(Qt.Key.Key_N)
    note = stage.field("Note on this run")
    assert QApplication.focusWidget() is note
    stage.qtbot.keyClicks(note, "rd")
    assert (note.text(), stage.tasks()) == ("rd", []), "letters in a field decide nothing"
    stage.qtbot.keyClick(note, Qt.Key.Key_Escape)
    focused = QApplication.focusWidget()
    assert isinstance(focused, QPushButton)
    stage.qtbot.keyClick(focused, Qt.Key.Key_D)
    assert stage.tasks() == [MoveToTrash(RUN, "me", "rd")]


def test_enter_in_the_note_hands_the_keyboard_on_to_the_next_test(stage: Stage) -> None:
    stage.record()
    stage.press(Qt.Key.Key_N)
    stage.qtbot.keyClick(stage.field("Note on this run"), Qt.Key.Key_Return)
    stage.qtbot.keyClick(QApplication.focusWidget(), Qt.Key.Key_A)
    assert len(stage.recorder.armed) == 2


@pytest.mark.parametrize("key", [Qt.Key.Key_Escape, Qt.Key.Key_Return])
def test_a_field_of_the_form_is_left_by_enter_and_escape_and_decides_nothing(
    stage: Stage, key: Qt.Key
) -> None:
    stage.record()
    stage.press(Qt.Key.Key_F2)
    operator = QApplication.focusWidget()
    assert operator is stage.field("Operator")
    stage.qtbot.keyClick(operator, key)
    assert stage.tasks() == []
    focused = QApplication.focusWidget()
    assert isinstance(focused, QPushButton)
    assert focused.text() == "Keep\nEnter"


def test_s_goes_to_the_series_and_the_arrows_choose_it(stage: Stage) -> None:
    stage.press(Qt.Key.Key_S)
    choice = QApplication.focusWidget()
    assert choice is not None
    stage.qtbot.keyClick(choice, Qt.Key.Key_Down)
    assert stage.presenter.state.choices.series == "1FFM2"
    stage.qtbot.keyClick(choice, Qt.Key.Key_A)
    assert [run.series for run in stage.recorder.armed] == ["1FFM2"]


def test_ctrl_z_asks_again_about_a_run_that_was_kept(stage: Stage) -> None:
    stage.record()
    stage.press(Qt.Key.Key_Return)
    assert "Model fits" not in stage.words()
    assert stage.button("Undo").toolTip() == "Decide again about 20260112_1FFM0_001 (Ctrl+Z)"
    stage.press(Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    for expected in ("Model fits", "Repeat", "Discard"):
        assert expected in stage.words()
    assert clipped_words(stage.screen) == []


def test_the_target_bar_stays_where_it_is_while_the_table_is_pulled_and_held(stage: Stage) -> None:
    stage.press(Qt.Key.Key_A)
    bar, steps = stage.screen.findChildren(TargetBar)[0], stage.screen.findChildren(Stepper)[0]
    places = []
    stage.recorder.rows = rows_between(0.0, 4.4)
    stage.presenter.tick()
    for state in (PullbackState.PULLING, PullbackState.HELD, PullbackState.ARMED):
        stage.presenter.dispatch(StateChanged(state, 4.4, "", standing(state)))
        QApplication.processEvents()
        assert bar.isVisible()
        places.append((bar.mapTo(stage.screen, bar.rect().topLeft()), steps.y()))
    assert len(set(places)) == 1, places


@pytest.mark.parametrize(("width", "rows"), [(330, 2), (700, 1)])
def test_steps_take_two_rows_where_one_has_no_room_for_them(qtbot: QtBot, width: int, rows: int) -> None:
    names = ("Nol", "Tortish", "Tutish", "Tayyor", "Sirpanish", "Tebranish", "Saqlash", "Natija")
    stepper = Stepper()
    qtbot.addWidget(stepper)
    stepper.show_steps(tuple(Step(name, StepStatus.AHEAD) for name in names))
    stepper.resize(width, 60)
    stepper.show()
    QApplication.processEvents()
    stepper.show_steps(tuple(Step(name, StepStatus.DONE) for name in names))
    QApplication.processEvents()
    shown = stepper.findChildren(QLabel)
    assert len({one.y() for one in shown}) == rows
    assert all(one.width() >= one.sizeHint().width() for one in shown)
    assert max(one.geometry().right() for one in shown) < width


def test_t_tares_and_shift_t_goes_back(stage: Stage) -> None:
    stage.recorder.rows = rows_between(0.0, 1.5)
    stage.presenter.tick()
    stage.press(Qt.Key.Key_T)
    assert stage.presenter.state.readings.table == "0.00"
    assert "✓ Tared by 0.20\u202fmm and 0.00\u202fmm" in stage.words()
    stage.press(Qt.Key.Key_T, Qt.KeyboardModifier.ShiftModifier)
    assert stage.presenter.state.readings.table == "0.20"


def test_the_plan_shows_what_is_done_about_the_series_that_is_chosen(stage: Stage) -> None:
    words = stage.words()
    for expected in ("1FFM0  ●●●", "1FFM1  ●○○", "Plan 4/108", "1FFM1 run 2 of 3"):
        assert expected in words
    stage.button("1FFM2").click()
    assert stage.presenter.state.choices.series == "1FFM2"


@pytest.mark.parametrize("language", ["en", "ru"])
def test_a_full_series_is_told_from_others_in_any_language(
    theme: Theme, qtbot: QtBot, use_language: Callable[[str], None], language: str
) -> None:
    use_language(language)
    strip = PlanStrip(lambda _: None)
    qtbot.addWidget(strip)
    progress = tuple(SeriesProgress(name, done, 3) for name, done in (("A", 3), ("B", 1), ("C", 0)))
    strip.show_plan(PlanState(text="", progress=progress), "B", choosable=True)
    buttons = strip.findChildren(QPushButton)
    assert [button.property("state") for button in buttons] == ["full", "now", "ahead"]


def test_as_much_of_the_plan_is_shown_as_fits(stage: Stage) -> None:
    def shown() -> int:
        QApplication.processEvents()
        return stage.words().count("○○○") + stage.words().count("●")

    counts = []
    for width in (932, 1188, 1828):
        stage.screen.resize(width, 700)
        counts.append(shown())
        assert "1FFM1  ●○○" in stage.words()
    assert counts == sorted(counts)
    assert counts[0] < counts[-1]


def test_what_is_known_of_the_next_tests_is_folded_into_a_line(stage: Stage) -> None:
    assert "N. Schwarz · 21.5\u202f°C · plate P1" in stage.words()
    assert not stage.field("Temperature, °C").isVisible()
    stage.press(Qt.Key.Key_F2)
    temperature = stage.field("Temperature, °C")
    assert temperature.isVisible()
    assert temperature.text() == "21.5"
    temperature.setText("")
    stage.qtbot.keyClicks(temperature, "warm")
    assert "Temperature in °C = 'warm' is not a number" in stage.words()


def test_nothing_is_filled_in_while_a_run_is_recorded(stage: Stage) -> None:
    stage.press(Qt.Key.Key_F2)
    stage.presenter.dispatch(StateChanged(PullbackState.ZERO, 1.0))
    assert not stage.field("Operator").isEnabled()
    assert not stage.button("1FFM2").isEnabled()


def test_the_button_of_esc_says_whether_there_will_be_a_run(stage: Stage) -> None:
    at_rest = standing(PullbackState.PULLING)
    stage.presenter.dispatch(StateChanged(PullbackState.PULLING, 1.0, position=at_rest))
    assert stage.button("Disarm   Esc").isEnabled()
    pulled = msgspec.structs.replace(at_rest, keeps_run=True)
    stage.presenter.dispatch(StateChanged(PullbackState.PULLING, 2.0, position=pulled))
    assert stage.button("Stop   Esc").isEnabled()


def test_every_cue_is_a_short_tone_of_its_own() -> None:
    made = {cue: sound.cue_wav(cue) for cue in Cue}
    assert len(set(made.values())) == len(Cue)
    for content in made.values():
        with wave.open(io.BytesIO(content)) as file:
            assert 0.05 < file.getnframes() / file.getframerate() < 1.0
            assert any(file.readframes(file.getnframes()))


def test_states_are_played_by_the_systems_player_or_its_bell(
    stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    played: list[str] = []
    monkeypatch.setattr(sound.CuePlayer, "play", lambda _self, cue: played.append(cue.value))
    stage.presenter.dispatch(StateChanged(PullbackState.ARMED, 1.0))
    assert played == []
    stage.presenter.dispatch(Settings(sounds=True))
    stage.presenter.dispatch(StateChanged(PullbackState.ARMED, 1.1))
    stage.presenter.dispatch(StateChanged(PullbackState.RELEASED, 1.2))
    stage.presenter.dispatch(ended())
    assert played == ["let-go", "released"]


@pytest.mark.parametrize("has_player", [True, False])
def test_where_there_is_no_player_the_bell_stands_for_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, has_player: bool
) -> None:
    started: list[tuple[str, list[str]]] = []
    rung: list[bool] = []
    monkeypatch.setattr(sound.platformdirs, "user_cache_path", lambda *_, **__: tmp_path)
    monkeypatch.setattr(sound.sys, "platform", "linux")
    monkeypatch.setattr(sound.shutil, "which", lambda name: name if has_player and name == "aplay" else None)
    monkeypatch.setattr(sound.QProcess, "startDetached", lambda *call: (started.append(call) is None, 1))
    monkeypatch.setattr(sound.QApplication, "beep", lambda: rung.append(True))
    sound.CuePlayer().play(Cue.RESULT)
    if has_player:
        ((program, arguments),) = started
        assert program == "aplay"
        assert Path(arguments[-1]).read_bytes() == sound.cue_wav(Cue.RESULT)
    assert bool(rung) is not has_player
