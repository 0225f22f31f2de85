"""The operator's part of a live calibration: move, read the dial, type it, again."""

import sys
from pathlib import Path

import numpy as np

from analysis.calibration.points import CalibrationPoints
from app.acquisition.averaged_counts import AveragedCounts, CountAverager, NoAverageError
from app.acquisition.messages import PortSettings
from app.acquisition.run_setup import complete_port_settings
from app.acquisition.stream.live_stream import open_stream
from app.cli import output as out
from app.cli.errors import CommandError
from app.runs.calibration_points import write_points
from config.schema import Gauges

_WINDOWS = 5


def measure_points(
    port: PortSettings, gauges: Gauges, channel: int, window_s: float, kept: Path
) -> CalibrationPoints:
    """Ask for dial readings on stdin and average the counts at each; `kept` is written with every one.

    Raises DriverError, AcquisitionError, CalibrationError.
    """
    with (
        open_stream(complete_port_settings(port, gauges.device), gauges) as stream,
        CountAverager(stream, channel) as still,
    ):
        out.print_status(
            f"{stream.identity.name or port.protocol}, {stream.rate_hz:g} Hz. Move the table in steps up and"
            " down, two rounds or more; at each, type what the dial shows (mm)."
            " `undo` takes the last one back, an empty line ends."
        )
        dialogue = _Dialogue(still, window_s, kept)
        while dialogue.ask():
            pass
    counts, dial_m = dialogue.counts, np.array(dialogue.dial_mm) * 1e-3
    if counts:
        out.print_status(f"readings kept in {kept}")
    return CalibrationPoints.from_readings(counts, dial_m)


class _Dialogue:
    def __init__(self, still: CountAverager, window_s: float, kept: Path) -> None:
        self._still = still
        self._window_s = window_s
        self._kept = kept
        self.counts: list[float] = []
        self.dial_mm: list[float] = []

    def ask(self) -> bool:
        """Take one line; tell whether there is more to come."""
        sys.stderr.write(f"dial {len(self.counts) + 1} (mm): ")
        sys.stderr.flush()
        line = sys.stdin.readline().strip()
        if line in ("", "end"):
            return False
        if line == "undo":
            self._undo()
            return True
        try:
            dial_mm = float(line.replace(",", "."))
        except ValueError:
            out.print_status(f"{line!r} is not a number of millimetres. Type it again")
            return True
        self._take(dial_mm)
        return True

    def _undo(self) -> None:
        if self.counts:
            self.counts.pop()
            out.print_status(f"{self.dial_mm.pop():g} mm taken back")
            self._keep()

    def _take(self, dial_mm: float) -> None:
        try:
            average = self._still.steady_average(self._window_s, _WINDOWS, _print_moving)
        except NoAverageError as error:
            out.print_status(f"not taken: {error}")
            return
        if not average.is_steady:
            out.print_status(f"still creeping by {average.creep_counts:.3g} counts; taken as it is")
        self.counts.append(average.counts)
        self.dial_mm.append(dial_mm)
        self._keep()
        out.print_status(f"{dial_mm:g} mm: {average.counts:.8g} counts, noise {average.noise_counts:.3g}")

    def _keep(self) -> None:
        try:
            write_points(self._kept, self.counts, [dial_mm * 1e-3 for dial_mm in self.dial_mm])
        except OSError as error:
            raise CommandError(
                f"{self._kept}: cannot be written ({error.strerror}). Check the folder, its rights"
                " and its disk"
            ) from None


def _print_moving(average: AveragedCounts) -> None:
    out.print_status(f"still moving by {average.creep_counts:.3g} counts, waiting")
