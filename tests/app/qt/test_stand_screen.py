"""The Simulated stand screen: fields, faults and truth follow the state; keys and clicks do their work."""

import pytest
from looking import clipped_words, visible_words
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication, QLineEdit
from pytestqt.qtbot import QtBot
from stage import FakeSimulation

from app.presenters.stand_screen import StandPresenter
from app.qt.stand_screen import StandScreen
from app.qt.theme import Theme
from app.simulated_stand.options import SimulatedStandOptions


class Stage:
    """Screen and presenter, shown."""

    def __init__(self, qtbot: QtBot) -> None:
        self.qtbot = qtbot
        self.opened: list[SimulatedStandOptions] = []
        self.stand: FakeSimulation | None = None
        options = SimulatedStandOptions()
        self.presenter = StandPresenter(options, ("1FFM0", "2SSM1"), self.opened.append, lambda: self.stand)
        self.screen = StandScreen(self.presenter)
        qtbot.addWidget(self.screen)
        self.screen.resize(1188, 800)
        self.presenter.attach(self.screen)
        self.screen.show()
        qtbot.waitExposed(self.screen)

    def run(self) -> FakeSimulation:
        self.stand = FakeSimulation(SimulatedStandOptions())
        self.presenter.tick()
        return self.stand

    def field(self, name: str) -> QLineEdit:
        (found,) = [f for f in self.screen.findChildren(QLineEdit) if f.accessibleName() == name]
        return found


@pytest.fixture
def stage(theme: Theme, qtbot: QtBot) -> Stage:
    return Stage(qtbot)


def test_what_is_typed_starts_a_stand_by_a_key(stage: Stage) -> None:
    assert stage.field("Noise, µm").placeholderText() == "20"
    stage.qtbot.keyClicks(stage.field("Noise, µm"), "5")
    stage.qtbot.keyClick(stage.field("Noise, µm"), Qt.Key.Key_Return, Qt.KeyboardModifier.ControlModifier)
    assert [options.noise_m for options in stage.opened] == [5e-6]


def test_symbols_are_set_as_in_the_paper(stage: Stage) -> None:
    stage.run()
    words = visible_words(stage.screen)
    assert "Friction fd" in words
    assert "n1" in words
    assert "_" not in words
    assert stage.field("Friction fd").placeholderText() == "0.1"


def test_faults_are_asked_for_by_click_and_key_while_it_runs(stage: Stage) -> None:
    assert "while the simulated stand is connected" in visible_words(stage.screen)
    stage.qtbot.keyClick(stage.screen, Qt.Key.Key_1, Qt.KeyboardModifier.AltModifier)
    stand = stage.run()
    stage.qtbot.mouseClick(stage.screen._faults["unplug"], Qt.MouseButton.LeftButton)
    stage.qtbot.keyClick(stage.screen, Qt.Key.Key_1, Qt.KeyboardModifier.AltModifier)
    assert stand.disturbed == ["unplug 2", "stall 2"]
    assert "10.100" in visible_words(stage.screen)


@pytest.mark.parametrize("size", [(932, 640), (1188, 800), (1828, 1080)], ids=lambda size: f"{size[0]}")
def test_no_word_is_cut_off(stage: Stage, size: tuple[int, int]) -> None:
    stage.screen.resize(*size)
    QApplication.processEvents()
    assert clipped_words(stage.screen) == []
    stage.run()
    stage.presenter.set_fault_duration("soon")
    stage.presenter.inject_fault("stall")
    QApplication.processEvents()
    assert "soon" in visible_words(stage.screen)
    assert clipped_words(stage.screen) == []
