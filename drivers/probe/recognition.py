"""Which of the built protocols some received bytes are, by what its own decoder finds in them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from drivers.csv_lines import openscale
from drivers.csv_lines.codec import first_line_start, rate_from_lines, whole_lines_end
from drivers.csv_lines.column_inference import infer_columns
from drivers.csv_lines.columns import CHECKSUMS, LineFormat
from drivers.csv_lines.line_parser import LineParser
from drivers.gsv.codec import FrameDecoder, FrameLayout, ValueKind, find_layout
from drivers.harp.codec import EVENT_BYTES, LINE, find_events, rate_from_events
from drivers.slipstand_binary.codec import find_frame_headers, frame_length, rate_from_frames

_GAUGES = 2
MIN_PACKETS = 3
"""Frames or lines that must be there."""
_SURE_SHARE = 0.25
_FAIR_SHARE = 0.7
"""Part of the bytes that must be in good frames or lines: with a checksum, and without."""


@dataclass(frozen=True, slots=True)
class Recognition:
    """A protocol that bytes are, and how to read them.

    Attributes
    ----------
    protocol : str
    settings : dict
        The device's own, as `--set` takes them.
    share : float
        Part of the bytes that is in good frames or lines, 0 to 1.
    packets : int
        Good frames or lines.
    channels : int
        Gauges that the device has.
    rate_hz : float or None
        Samples a second by the device's own times, else by when the bytes came; None if neither tells.
    needs_rate : bool
        Whether the device does not tell its rate, so that `--rate` must.
    remark : str
        What to look at before recording.
    """

    protocol: str
    share: float
    packets: int
    channels: int = 2
    settings: dict[str, str] = field(default_factory=dict)
    rate_hz: float | None = None
    needs_rate: bool = False
    remark: str = ""

    @property
    def rate_option(self) -> str:
        """Value of `--rate` to three digits, without an exponent; empty where none is wanted or known."""
        return f"{float(f'{self.rate_hz:.3g}'):.6g}" if self.needs_rate and self.rate_hz else ""


def recognise(data: bytes, duration_s: float | None = None) -> Recognition | None:
    """The protocol that `data` are, the most likely one; None if they are none that is built.

    Parameters
    ----------
    data : bytes
        As received; the first and the last frame or line may be cut.
    duration_s : float, optional
        Time from the first to the last of them.
    """
    found = [one for look in _RECOGNISERS for one in look(data, duration_s)]
    return max(found, key=lambda one: one.share, default=None)


def _slipstand_binary(data: bytes, duration_s: float | None) -> Iterator[Recognition]:
    frames = find_frame_headers(data)
    share = sum(frame_length(int(n)) for n in frames["n"]) / max(len(data), 1)
    if len(frames) >= MIN_PACKETS and share >= _SURE_SHARE:
        rate_hz = rate_from_frames(data) or _a_second(int(frames["n"].sum()), duration_s)
        yield Recognition("slipstand-binary", share, len(frames), rate_hz=rate_hz)


def _harp(data: bytes, duration_s: float | None) -> Iterator[Recognition]:
    lines = np.empty(2 * len(data) // EVENT_BYTES + 2, dtype=LINE)
    buffer = np.frombuffer(data, dtype=np.uint8)
    found, _, _, _ = find_events(buffer, np.zeros(2, dtype=np.int64), 0, lines)
    events = int(np.count_nonzero(lines["good"][:found]))
    share = events * EVENT_BYTES / max(len(data), 1)
    if events >= MIN_PACKETS and share >= _SURE_SHARE:
        rate_hz = rate_from_events(data) or _a_second(events, duration_s)
        remark = "say which channels the gauges are: --set table=N --set relative=N"
        yield Recognition("harp", share, events, rate_hz=rate_hz, remark=remark)


def _gsv(data: bytes, duration_s: float | None) -> Iterator[Recognition]:
    found = find_layout(data)
    if found is None or found[0] < _GAUGES:
        return
    channels, kind = found
    layout = FrameLayout(channels, kind)
    frames = sum(map(len, FrameDecoder(layout, 1.0).feed(data, 0)))
    share = frames * layout.length / max(len(data), 1)
    if frames >= MIN_PACKETS and share >= _FAIR_SHARE:
        settings = {} if kind is ValueKind.FLOAT32 else {"format": "device"}
        which = f"of its {channels} channels say which the gauges are: --set table=N --set relative=N"
        remark = which if channels > _GAUGES else ""
        rate_hz = _a_second(frames, duration_s)
        yield Recognition("gsv", share, frames, settings=settings, rate_hz=rate_hz, remark=remark)


def _openscale(data: bytes, duration_s: float | None) -> Iterator[Recognition]:
    layout = openscale.find_layout(data)
    if layout is not None:
        yield from _lines(layout, data, duration_s, {"format": "openscale"})


def _csv(data: bytes, duration_s: float | None) -> Iterator[Recognition]:
    guess = infer_columns(data, duration_s)
    if guess is not None:
        yield from _lines(guess.layout, data, duration_s, guess.settings, guess.remark)


def _lines(
    layout: LineFormat, data: bytes, duration_s: float | None, settings: dict[str, str], remark: str = ""
) -> Iterator[Recognition]:
    whole = data[first_line_start(data) : whole_lines_end(data)]
    lines = LineParser(layout).read(whole)
    good = lines[lines["good"] != 0]
    share = int((good["end"] - good["start"] + 1).sum()) / max(len(whole.replace(b"\r\n", b"\n")), 1)
    wanted = _SURE_SHARE if layout.checksum in CHECKSUMS else _FAIR_SHARE
    if len(good) >= MIN_PACKETS and share >= wanted:
        rate_hz = rate_from_lines(layout, data)
        yield Recognition(
            "csv",
            min(share, 1.0),
            len(good),
            layout.channels,
            settings,
            rate_hz or _a_second(len(good) + 1, duration_s),  # the first line is left out
            layout.time_column is None,
            remark,
        )


def _a_second(units: int, duration_s: float | None) -> float | None:
    return float(f"{(units - 1) / duration_s:.3g}") if duration_s and units > 1 else None


_RECOGNISERS: tuple[Callable[[bytes, float | None], Iterator[Recognition]], ...] = (
    _slipstand_binary,
    _harp,
    _gsv,
    _openscale,
    _csv,
)
