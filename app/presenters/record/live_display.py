"""What both gauges show at this moment: their newest readings, and the traces as they roll by."""

from app.acquisition.pullback.plan import AllowedPlateRange
from app.acquisition.ring import RingRows
from app.presenters import number_text
from app.presenters.base import Chip
from app.presenters.record.live_traces import LiveTraces
from app.presenters.record.state import LiveReadings, Traces
from app.presenters.record.status_bar import no_tare_chip, origin_text, tare_chip

_READINGS_EVERY_S = 0.1
_LEAST_PIXELS = 64


class LiveDisplay:
    """Draws live samples, unless a run that has ended is looked at.

    Parameters
    ----------
    live : LiveTraces
    """

    def __init__(self, live: LiveTraces) -> None:
        self.live = live
        self.traces = Traces()
        self.readings = LiveReadings()
        self.pixels = 800
        self._read_s = float("-inf")

    def resized(self, pixels: int) -> None:
        """Width of the plots."""
        self.pixels = max(pixels, _LEAST_PIXELS)

    def append(self, rows: RingRows, pullback_m: float, room: AllowedPlateRange | None) -> bool:
        """Draw new rows; tell whether the readings were read anew too, which is not done for each.

        Parameters
        ----------
        rows : RingRows
            At least one.
        pullback_m : float
            How far the table is pulled back.
        room : PlateRoom or None
            Where the plate may stand, if that is to be drawn.
        """
        settled = self.live.is_settled
        self.live.append(rows)
        if not settled:
            self.traces = self.live.render(self.pixels, pullback_m, room)
        newest_s = float(rows.time_s[-1])
        if newest_s - self._read_s < _READINGS_EVERY_S:
            return False
        self._read_s = newest_s
        self._read()
        return True

    def tare(self) -> Chip:
        """Show both gauges from where they stand; say what came of it."""
        said = tare_chip(self.live.tare_m) if self.live.tare() else no_tare_chip()
        self._read()
        return said

    def untare(self) -> None:
        """Show both gauges by the calibration again."""
        self.live.untare()
        self._read()

    def hold(self, traces: Traces) -> None:
        """Show a run of before, until the next one begins."""
        self.live.hold()
        self.traces = traces

    def start_over(self) -> None:
        """Other samples come from now on; what is drawn stays until then, or until `clear`."""
        self._read_s = float("-inf")
        self.live.untare()
        self.live.restart()
        self.live.history.clear()
        self.readings = LiveReadings()

    def clear(self, pullback_m: float) -> None:
        """Draw what has come since `start_over`, which may be nothing."""
        self.traces = self.live.render(self.pixels, pullback_m)

    def _read(self) -> None:
        table, relative = (number_text.format_millimetres(value, 2) for value in self.live.newest_m())
        self.readings = LiveReadings(table, relative, origin_text(self.live))
