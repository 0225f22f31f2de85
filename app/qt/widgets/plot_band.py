"""A line whose swings cannot be told apart, as a picture: filled from lowest to highest in each column."""

import math

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, QSizeF
from PySide6.QtGui import QColor, QImage, QPainter, QTransform

from app.presenters.decimated_history import Polyline

Floats = NDArray[np.float64]

_BLOCK_ROWS = 32
"""Rows of pixels made at once: memory for all of them would be asked from the system anew with each frame,
and takes six times as long as the arithmetic."""


class Band:
    """Draws a line of lowest and highest values of spans, into pictures only.

    As a polygon Qt would fill it in a time that grows with the square of its edges, up to seconds.
    """

    def __init__(self) -> None:
        self._starts_s = self._low = self._high = np.empty(0)
        self._end_s = 0.0
        self._made_for: tuple[object, ...] = ()
        self._strips: list[tuple[QPointF, QImage]] = []
        self._full = QRectF()
        self._pixels = np.empty(0, np.uint32)  # of the pictures, which do not own them

    def show_line(self, line: Polyline) -> None:
        """Draw another line from now on, of two spans at least."""
        self._starts_s, self._low, self._high = line.time_s[::2], line.value[::2], line.value[1::2]
        self._end_s = 2.0 * line.time_s[-1] - line.time_s[-3]
        self._made_for = ()

    def paint(self, painter: QPainter, seen: QRectF, ink: QColor) -> None:
        """Fill the part `seen`, in units of the line, through the transform of the painter."""
        transform, ratio = QTransform(painter.worldTransform()), painter.device().devicePixelRatioF()
        place = transform.mapRect(seen)
        wanted = (transform, place, ratio, ink.rgba())
        if wanted != self._made_for:
            self._made_for = wanted
            self._draw(transform, place, ratio, ink)
        painter.save()
        painter.resetTransform()
        for corner, image in self._strips:
            painter.drawImage(corner, image)
        painter.fillRect(self._full, ink)
        painter.restore()

    def _draw(self, transform: QTransform, place: QRectF, ratio: float, ink: QColor) -> None:
        width, height = (math.ceil(length * ratio) for length in (place.width(), place.height()))
        x = ratio * (transform.m11() * np.append(self._starts_s, self._end_s) + transform.dx() - place.left())
        highest, lowest = (
            ratio * (transform.m22() * values + transform.dy() - place.top())
            for values in (self._high, self._low)
        )
        columns = np.flatnonzero((np.arange(width) + 1.0 > x[0]) & (np.arange(width) < x[-1]))
        self._strips, self._full = [], QRectF()
        if not len(columns):
            return
        tops, ends = (rows.clip(0, height) for rows in _columns(columns, x, highest, lowest))
        left = place.left() + columns[0] / ratio
        full = range(int(tops.max()), int(ends.min()))  # rows that all columns fill
        if full:
            corner = QPointF(left, place.top() + full.start / ratio)
            self._full = QRectF(corner, QSizeF(len(columns), len(full)) / ratio)
        ragged = _ragged_rows(range(int(tops.min()), int(ends.max())), full)
        if len(self._pixels) < (needed := len(columns) * sum(map(len, ragged))):
            self._pixels = np.empty(needed, np.uint32)
        pixels = self._pixels
        for rows in ragged:
            part, pixels = np.split(pixels, [len(rows) * len(columns)])
            image = _fill(part.reshape(len(rows), len(columns)), rows, tops, ends, _premultiplied(ink))
            image.setDevicePixelRatio(ratio)
            self._strips.append((QPointF(left, place.top() + rows.start / ratio), image))


def _ragged_rows(rows: range, full: range) -> list[range]:
    """Those of `rows` above and below the `full` ones."""
    parts = [range(rows.start, full.start), range(full.stop, rows.stop)] if full else [rows]
    return [part for part in parts if part]


def _fill(
    pixels: NDArray[np.uint32], rows: range, tops: NDArray[np.intp], ends: NDArray[np.intp], ink: np.uint32
) -> QImage:
    """Picture in `pixels` (rows, columns), each column with ink from its top to its end."""
    # A row is filled from the first to the last of its column: one comparison, since whole numbers wrap.
    first = tops.astype(np.uint16)
    counts = (ends - tops).astype(np.uint16)
    numbers = np.arange(rows.start, rows.stop, dtype=np.uint16)[:, np.newaxis]
    for start in range(0, len(rows), _BLOCK_ROWS):
        block = slice(start, start + _BLOCK_ROWS)
        is_filled = (numbers[block] - first < counts).view(np.uint8)
        np.multiply(is_filled, ink, out=pixels[block], dtype=np.uint32)
    height, width = pixels.shape
    # In the format of the screen: Qt would convert another one in other threads, and wait for them.
    return QImage(pixels.data, width, height, 4 * width, QImage.Format.Format_ARGB32_Premultiplied)


def _columns(
    columns: NDArray[np.intp], x: Floats, highest: Floats, lowest: Floats
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First and last row of each column of pixels: of all spans in it, and up to where its neighbour begins.

    `x` has the edges of the spans. Where values are absent both rows are 0.
    """
    begun = np.searchsorted(x, np.append(columns, columns[-1] + 1.0))  # before each edge of a column
    first = begun[:-1] - (x[begun[:-1]] != columns)
    spans = np.column_stack((first, begun[1:])).clip(0, len(highest)).ravel()
    top = np.fmin.reduceat(np.append(highest, np.nan), spans)[::2]
    bottom = np.fmax.reduceat(np.append(lowest, np.nan), spans)[::2]
    own_top = top.copy()
    top[1:] = np.fmin(top[1:], bottom[:-1])
    bottom[1:] = np.fmax(bottom[1:], own_top[:-1])
    is_present = np.isfinite(own_top)
    tops = np.floor(np.where(is_present, top, 0.0)).astype(np.intp)
    bottoms = np.ceil(np.where(is_present, bottom, 0.0)).astype(np.intp)
    return tops, np.where(is_present, np.maximum(bottoms, tops + 1), 0)


def _premultiplied(ink: QColor) -> np.uint32:
    alpha = ink.alpha()
    red, green, blue = (value * alpha // 255 for value in (ink.red(), ink.green(), ink.blue()))
    return np.uint32(alpha << 24 | red << 16 | green << 8 | blue)
