"""Recorded runs, as values."""

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from analysis.record import Record
from app.runs import reader
from app.runs.analysis_input import to_record


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """A run as stored, with all edits applied; build it with `read_run`."""

    path: Path
    stored: reader.Run
    """The internal value. It may change with any version."""

    @property
    def series(self) -> str | None:
        """Code of the series; None of a run without one."""
        return self.stored.metadata.series

    @property
    def metadata(self) -> dict[str, Any]:
        """What is known of the run as plain values: operator, note, masses, stand, gauges, device."""
        known: dict[str, Any] = msgspec.to_builtins(self.stored.metadata)
        return known

    @property
    def record(self) -> Record:
        """The displacements with masses and calibration, as `identify` takes them.

        Absent samples are NaN. Raises RunError where the readings are no displacements in metres.
        """
        return to_record(self.stored)

    @property
    def time_s(self) -> NDArray[np.float64]:
        """(n,): seconds since the first stored sample, on the device's or nominal clock."""
        return self.stored.time_s

    @property
    def table_reading(self) -> NDArray[np.float64]:
        """(n,): gauge 1, in `unit`; NaN where absent."""
        return self.stored.table_reading

    @property
    def relative_reading(self) -> NDArray[np.float64] | None:
        """(n,): gauge 2, in `unit`; None without one."""
        return self.stored.relative_reading

    @property
    def unit(self) -> str:
        """Unit of the readings: "m" of displacements."""
        return self.stored.metadata.unit

    @property
    def analyses(self) -> list[dict[str, Any]]:
        """Results that are kept in the run, oldest first, each as `slipstand analyze --json` prints it."""
        return [saved.document for saved in self.stored.analyses]

    def __len__(self) -> int:
        return len(self.stored)

    def __repr__(self) -> str:
        return f"<Run {self.path.name}: {self.stored.metadata.title}, {len(self)} samples>"


def read_run(path: str | PathLike[str]) -> Run:
    """Read a run file. Raises RunError: there is none, it is no run, being recorded, or damaged."""
    stored = reader.open_run(Path(path))
    return Run(stored.path, stored)
