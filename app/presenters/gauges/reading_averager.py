"""One reading of a gauge that stands still: windows of live samples until it does."""

import math
from dataclasses import dataclass
from typing import Final

from app.acquisition.gauge_samples import AveragedCounts
from app.presenters.gauges.recent_samples import InvalidWindow, RecentSamples, average_counts
from app.presenters.number_text import with_minus_sign
from config.schema import Gauges
from messages.i18n import gettext

WINDOW_S: Final = 1.0
MAX_WINDOWS: Final = 5
"""A reading waits for so many windows at most until the gauge stands still."""
_STALE_S: Final = 0.1
"""What was sampled before it was asked for may still be under way."""


@dataclass(frozen=True, slots=True)
class StillMoving:
    """The gauge does not stand still yet."""

    text: str


class ReadingAverager:
    """Takes a reading.

    Parameters
    ----------
    recent : RecentSamples
        Live samples.
    """

    def __init__(self, recent: RecentSamples) -> None:
        self._recent = recent
        self._since_s = math.nan
        self._windows = 0

    @property
    def is_active(self) -> bool:
        """Tell whether a reading is being taken."""
        return self._windows > 0

    def start(self) -> bool:
        """Average from now on; False where there are no samples."""
        if not math.isfinite(self._recent.end_s):
            return False
        self._windows, self._since_s = 1, self._recent.end_s + _STALE_S
        return True

    def stop(self) -> None:
        """Leave the reading that is being taken."""
        self._windows = 0

    def poll(self, gauge: int, gauges: Gauges) -> AveragedCounts | InvalidWindow | StillMoving | None:
        """What a window shows once it is over: the reading, or why there is none yet.

        The last window is taken though the gauge may still be creeping.
        """
        if not self.is_active or self._recent.end_s < self._since_s + WINDOW_S:
            return None
        rows = self._recent.since(self._since_s)
        if rows is None:
            return None
        seen = average_counts(rows, gauge, gauges)
        if isinstance(seen, InvalidWindow) or seen.is_steady or self._windows == MAX_WINDOWS:
            self.stop()
            return seen
        self._windows, self._since_s = self._windows + 1, self._recent.end_s
        creep = with_minus_sign(f"{seen.creep_counts:.3g}")
        return StillMoving(gettext("Still moving by {creep} counts, waiting", creep=creep))
