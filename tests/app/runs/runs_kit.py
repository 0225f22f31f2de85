"""Blocks, endings and files that several run tests need."""

import datetime
from pathlib import Path

import numpy as np

from app.runs.blocks import BlockLayout, RunBlock, StoredRun
from app.runs.metadata import EndMetadata, Events, RunMetadata
from app.runs.writer import write_run
from drivers.clock import TimeBase
from drivers.samples import Losses

END = datetime.datetime(2026, 11, 21, 13, 32, 30, tzinfo=datetime.UTC)
ENDING = EndMetadata(
    ended="rest",
    end_time=END,
    events=Events(pulled_back_s=1.0, release_s=2.25, slip_end_s=4.5),
    losses=Losses(samples=9, missing=2, missing_estimated=1, damaged=3, overloaded=4, discarded_bytes=5),
    time_base=TimeBase(1.00002, 3e-6),
    dwell_s=1.125,
    zero_m=1.5e-4,
    relative_zero_m=-2.5e-4,
    held_m=0.01215,
    message="all well",
)

ANALYSIS = {
    "schema": "slipstand-analysis/1",
    "run": "run.h5",
    "series": "1FFM1",
    "kind": "two-mass",
    "results": {
        "friction_dynamic": {
            "value": 0.1, "standard_uncertainty": 4e-4, "interval_95": [0.0992, 0.1008], "unit": "1",
        },
        "period_s": {"value": 0.32, "standard_uncertainty": None, "interval_95": None, "unit": "s"},
        "msk64_degree": "VIII (8, 16]",
    },
    "model": {"name": "coulomb", "adequate": False, "residual_rms_m": 2e-5, "noise_rms_m": 2e-5, "tried": []},
    "budget": [],
    "events": {"release_s": 1.0},
    "warnings": [],
    "quality": {},
}  # fmt: skip
"""An analysis as `analyze --json` gives it."""


def block(first: int, count: int, layout: BlockLayout | None = None) -> RunBlock:
    """Rows whose every value tells its row."""
    layout = layout or BlockLayout()
    row = np.arange(first, first + count)
    columns = np.stack([row + 1000 * channel for channel in range(layout.channels)], axis=1)
    counts = columns.astype(layout.counts) if layout.counts else None
    return RunBlock(row / 500.0, columns * 1e-6, np.zeros(count, np.uint8), counts)


def text_file(folder: Path, content: str | bytes) -> Path:
    """A file with this content."""
    path = folder / "record.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def small_run(path: Path, metadata: RunMetadata, rows: int = 100) -> StoredRun:
    """A closed run of a few rows."""
    return write_run(path, metadata, block(0, rows), ENDING)
