"""A line whose swings cannot be told apart, as a picture: filled from lowest to highest in each column."""

import math

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QRectF
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
        self._image = QImage()
        self._pixels = np.empty((0, 0), np.uint32)  # of the image, which does not own them

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
        painter.drawImage(place.topLeft(), self._image)
        painter.restore()

    def _draw(self, transform: QTransform, place: QRectF, ratio: float, ink: QColor) -> None:
        width, height = (math.ceil(length * ratio) for length in (place.width(), place.height()))
        x = ratio * (transform.m11() * np.append(self._starts_s, self._end_s) + transform.dx() - place.left())
        highest, lowest = (
            ratio * (transform.m22() * values + transform.dy() - place.top())
            for values in (self._high, self._low)
        )
        columns = np.flatnonzero((np.arange(width) + 1.0 > x[0]) & (np.arange(width) < x[-1]))
        tops, bottoms = _columns(columns, x, highest, lowest)
        # A row is filled from the first to the last of its column: one comparison, since whole numbers wrap.
        top_rows, row_counts = np.zeros((2, width), np.uint16)
        top_rows[columns] = tops.clip(0, height)
        row_counts[columns] = bottoms.clip(0, height) - top_rows[columns]
        if self._pixels.shape != (height, width):
            self._pixels = np.empty((height, width), np.uint32)
            # In the format of the screen: Qt would convert another one in other threads, and wait for them.
            self._image = QImage(
                self._pixels.data, width, height, 4 * width, QImage.Format.Format_ARGB32_Premultiplied
            )
        rows = np.arange(height, dtype=np.uint16)[:, np.newaxis]
        for first in range(0, height, _BLOCK_ROWS):
            block = slice(first, first + _BLOCK_ROWS)
            is_filled = (rows[block] - top_rows < row_counts).view(np.uint8)
            np.multiply(is_filled, _premultiplied(ink), out=self._pixels[block], dtype=np.uint32)
        self._image.setDevicePixelRatio(ratio)


def _columns(
    columns: NDArray[np.intp], x: Floats, highest: Floats, lowest: Floats
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First and last row of each column of pixels: of all spans in it, and up to where its neighbour begins.

    `x` has the edges of the spans. Where values are absent both rows are 0.
    """
    first = np.searchsorted(x, columns, side="right") - 1
    end = np.searchsorted(x, columns + 1.0).clip(max=len(highest))
    spans = np.column_stack((first.clip(0), end)).ravel()
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
