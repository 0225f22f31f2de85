"""A dense line as a picture, held against each of its pixels."""

import numpy as np
import pytest
from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QImage, QPainter
from pytestqt.qtbot import QtBot

from app.presenters.decimated_history import Polyline
from app.qt.widgets.plot_band import Band

WIDTH, HEIGHT = 120, 80


def drawn(line: Polyline, seen: QRectF, ink: QColor, ratio: float = 1.0) -> QImage:
    image = QImage(round(WIDTH * ratio), round(HEIGHT * ratio), QImage.Format.Format_RGB32)
    image.setDevicePixelRatio(ratio)
    image.fill(Qt.GlobalColor.white)
    painter = QPainter(image)
    painter.scale(WIDTH / seen.width(), -HEIGHT / seen.height())
    painter.translate(-seen.left(), -seen.bottom())
    band = Band()
    band.show_line(line)
    band.paint(painter, seen, ink)
    painter.end()
    return image


def is_ink(image: QImage) -> np.ndarray:
    reds = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), -1, 4)[:, :, 2]
    return reds < 128


def extremes(time_s: np.ndarray, low: np.ndarray, high: np.ndarray) -> Polyline:
    return Polyline(np.repeat(time_s, 2), np.column_stack((low, high)).ravel())


@pytest.mark.parametrize("ratio", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("spans_a_pixel", [0.2, 1.0, 1.7])
def test_each_column_is_filled_from_its_lowest_to_its_highest(
    qtbot: QtBot, spans_a_pixel: float, ratio: float
) -> None:
    random = np.random.default_rng(3)
    count = round(WIDTH * spans_a_pixel)
    time_s = np.arange(count) * WIDTH / count
    low = random.uniform(5.0, 35.0, count)
    high = random.uniform(45.0, 75.0, count)
    inked = is_ink(
        drawn(extremes(time_s, low, high), QRectF(0.0, 0.0, WIDTH, HEIGHT), QColor("black"), ratio)
    )
    edges = np.append(time_s, WIDTH)
    for column in range(inked.shape[1]):
        at = (edges[:-1] < (column + 1) / ratio) & (edges[1:] > column / ratio)
        rows = np.flatnonzero(inked[:, column]) / ratio
        top, bottom = HEIGHT - high[at].max(), HEIGHT - low[at].min()
        assert rows.min() == pytest.approx(top, abs=1.0 / ratio)
        assert rows.max() + 1.0 / ratio == pytest.approx(bottom, abs=1.0 / ratio)


def test_a_gap_stays_empty_and_a_flat_line_is_seen(qtbot: QtBot) -> None:
    time_s = np.arange(WIDTH, dtype=float)
    low = np.full(WIDTH, 40.0)
    low[50:70] = np.nan
    inked = is_ink(drawn(extremes(time_s, low, low), QRectF(0.0, 0.0, WIDTH, HEIGHT), QColor("black")))
    filled = inked.sum(axis=0)
    assert set(filled[50:70]) == {0}
    assert set(np.delete(filled, range(50, 70))) == {1}


def test_a_steep_line_has_no_holes(qtbot: QtBot) -> None:
    time_s = np.arange(WIDTH, dtype=float)
    low = np.where(time_s < 60, 10.0, 60.0)
    inked = is_ink(drawn(extremes(time_s, low, low + 2.0), QRectF(0.0, 0.0, WIDTH, HEIGHT), QColor("black")))
    assert inked[:, 60].sum() >= 48


def test_only_what_is_seen_is_drawn_and_what_shines_through_does(qtbot: QtBot) -> None:
    time_s = np.arange(200.0)
    line = extremes(time_s, np.full(200, 2.0), np.full(200, 200.0))
    image = drawn(line, QRectF(150.0, 0.0, 100.0, 100.0), QColor(0, 0, 0, 128))
    assert image.pixelColor(10, 10).red() == pytest.approx(127, abs=1)
    assert image.pixelColor(WIDTH - 10, 10).red() == 255, "behind the end of the line"
