"""What the command line says while it records."""

import msgspec
import numpy as np
import pytest
from ring_kit import ring_rows

from app.acquisition.messages import (
    Connected,
    EndReason,
    PullbackState,
    RunEnded,
    StandPosition,
    StateChanged,
)
from app.acquisition.ring import RingRows
from app.cli.progress_printer import ProgressPrinter, StatusLine

STANDING = StandPosition(0.012, 0.24e-3, 0.2e-3, 0.0)


class Line(StatusLine):
    """A terminal's line that only remembers."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    def on_event(self, event) -> None:
        """Nothing is known so far."""

    def update(self, text: str) -> None:
        """Keep what would be shown."""
        self.texts.append(text)


def rows(table_mm: float, relative_mm: float = 0.0) -> RingRows:
    time_s = np.arange(100) / 1000.0
    return ring_rows(0, time_s, np.full(100, table_mm / 1e3), np.full(100, relative_mm / 1e3))


def told(capsys) -> list[str]:
    return capsys.readouterr().err.splitlines()


def test_sentences_with_figures_each_once(capsys):
    printer = ProgressPrinter(Line())
    printer.on_event(StateChanged(PullbackState.ZERO, 0.0, position=StandPosition(0.012, 0.24e-3)))
    printer.on_rows(rows(0.2))
    printer.on_event(StateChanged(PullbackState.PULLING, 1.0, position=STANDING))
    printer.on_event(StateChanged(PullbackState.PULLING, 1.0, position=STANDING))
    printer.on_rows(rows(0.6))
    pulled = msgspec.structs.replace(STANDING, table_zero_m=0.19e-3, keeps_run=True)
    printer.on_event(StateChanged(PullbackState.PULLING, 1.5, position=pulled))
    printer.on_event(StateChanged(PullbackState.IDLE, 9.0))
    assert told(capsys) == [
        "Leave the stand alone: its zero is being taken.",
        "Pull the table back to 12.0\u202fmm: now 0.0\u202fmm",
    ]


def test_a_device_without_firmware_is_named_without_a_gap(capsys):
    printer = ProgressPrinter(Line())
    printer.on_event(Connected("CSV lines", "", 500.0, "ring"))
    printer.on_event(Connected("slipstand-fw", "1.2", 2000.0, "ring"))
    assert told(capsys) == ["connected: CSV lines, 500 Hz", "connected: slipstand-fw 1.2, 2000 Hz"]


def test_on_a_terminal_the_figure_follows_the_table(capsys):
    line = Line()
    printer = ProgressPrinter(line)
    printer.on_event(StateChanged(PullbackState.PULLING, 1.0, position=STANDING))
    for table_mm in (0.2, 6.2, 11.8):
        printer.on_rows(rows(table_mm))
    assert [text.rpartition(" ")[2] for text in line.texts] == ["0.0\u202fmm", "6.0\u202fmm", "11.6\u202fmm"]


@pytest.mark.parametrize(("on_base", "shown"), [(False, "−16.0\u202fmm."), (True, "−15.0\u202fmm.")])
def test_the_plate_is_told_as_gauge_2_reads(capsys, on_base, shown):
    printer = ProgressPrinter(Line(), gauge_2_on_base=on_base)
    printer.on_rows(rows(1.0, -16.0))
    standing = StandPosition(0.012, plate_m=-0.016, plate_wanted_m=0.0)
    printer.on_event(StateChanged(PullbackState.RECENTRE, 1.0, position=standing))
    assert told(capsys)[0].endswith(f"now {shown}")


def test_several_runs_are_numbered_and_each_end_is_told(capsys):
    printer = ProgressPrinter(Line(), 2)
    for number in (1, 2):
        printer.on_event(StateChanged(PullbackState.ZERO, 0.0))
        printer.on_event(RunEnded(f"{number}.h5", EndReason.REST, 9, 0, 0, 0, 0, 1e3, message="It drifted"))
    lines = told(capsys)
    assert [line for line in lines if line.startswith("run ")] == ["run 1 of 2", "run 2 of 2"]
    assert lines[-1] == "stored 2.h5: 9 samples, ended: rest. It drifted"


def test_a_release_that_came_too_early_is_told_with_what_to_do(capsys):
    printer = ProgressPrinter(Line())
    early = StandPosition(0.012, 0.24e-3, 0.2e-3, early_release_m=0.004)
    printer.on_event(StateChanged(PullbackState.ZERO, 2.0, position=early))
    note = "the table has not come to rest yet"
    printer.on_event(StateChanged(PullbackState.ZERO, 4.0, note, early))
    assert told(capsys) == [
        "Let go too early, at 4.0\u202fmm: put the plate back and pull again.",
        "Let go too early, at 4.0\u202fmm: put the plate back and pull again."
        " The table has not come to rest yet",
    ]


def test_a_recording_that_was_interrupted_before_the_pull_says_that_there_is_none(capsys):
    printer = ProgressPrinter(Line())
    printer.on_event(RunEnded("", EndReason.INTERRUPTED, 0, 0, 0, 0, 0, 1e3))
    assert told(capsys) == ["nothing was recorded: the table was not pulled back"]
