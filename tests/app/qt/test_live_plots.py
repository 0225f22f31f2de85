"""Live traces look the same whether a line is drawn stroke by stroke or as the band that it looks like."""

import numpy as np
import pytest
from PySide6.QtGui import QColor, QImage
from pytestqt.qtbot import QtBot

from analysis.catalogue import MICROMETRE, MILLIMETRE, use_displacement_unit
from app.presenters.decimated_history import DecimatedHistory, Polyline
from app.presenters.record.state import Traces
from app.qt.record.live_plots import LivePlots
from app.qt.theme import Theme
from app.qt.widgets import plot_curves

RATE_HZ = 2000.0


def drawn(theme: Theme, qtbot: QtBot) -> np.ndarray:
    """Where the first plot shows its curve: ten minutes of a swing between 2 and 6 mm, half of it silent."""
    time_s = np.arange(0.0, 600.0, 1 / RATE_HZ)
    table = np.where(time_s < 300.0, 4.0 + 2.0 * np.cos(20.0 * time_s), 5.0)
    history = DecimatedHistory()
    history.append(time_s, np.column_stack((table, np.zeros(len(time_s)))))
    lines = history.lines(0.0, 600.0, 1000)
    plots = LivePlots(theme)
    qtbot.addWidget(plots)
    plots.resize(1000, 600)
    plots.show()
    qtbot.waitExposed(plots)
    plots.show_traces(Traces(*lines, span=(0.0, 600.0), table_limit_mm=10.0))
    image = plots.grab().toImage().convertToFormat(QImage.Format.Format_RGB888)
    rows = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), image.bytesPerLine())
    red = rows[: 600 // 2, 3 * 60 : 3 * image.width() : 3].astype(int)
    ink, ground = (QColor(token).red() for token in (theme.tokens.channel_1, theme.tokens.surface))
    return np.abs(red - ink) < abs(ground - ink) // 2


def test_many_swings_a_pixel_are_drawn_as_the_band_they_look_like(
    theme: Theme, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    band = drawn(theme, qtbot)
    monkeypatch.setattr(plot_curves, "_DENSE_STROKES", np.inf)
    strokes = drawn(theme, qtbot)
    assert band.sum() > 10_000
    # Strokes are softened at their ends, bands are not: one pixel at either edge. The last span of the swing
    # is a stroke at its start, and reaches as a band into the next column.
    differences = np.abs(band.sum(axis=0) - strokes.sum(axis=0))
    assert np.count_nonzero(differences > 3) <= 1


def test_axes_titles_and_readouts_are_in_the_unit_of_the_settings(theme: Theme, qtbot: QtBot) -> None:
    use_displacement_unit(MICROMETRE)
    try:
        plots = LivePlots(theme)
        qtbot.addWidget(plots)
        line = Polyline(np.array([0.0, 1.0]), np.array([0.0, 12.0]))
        plots.show_traces(Traces(line, line, span=(0.0, 1.0)))
        plots._hover(1.0)
        table = plots._stack.plots[0]
        assert table.left.tickStrings([12.0], table.left.scale, 1.0) == ["12000"]
        assert "µm" in table.title.text
        assert "12000\u202fµm" in table.readout.text
    finally:
        use_displacement_unit(MILLIMETRE)
