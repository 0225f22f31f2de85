"""An operator's day in the program itself, on a window system with a window manager, by pointer and keys."""

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from real_desk import Desk, middle_of, missing_programs, program, running, window_system

from app.runs.reader import open_run

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="Xvfb is a window system of Linux"),
    pytest.mark.skipif(bool(missing_programs()), reason=f"not installed: {', '.join(missing_programs())}"),
]

QUICK = ("--series", "3FFM0", "--pull", "0.5", "--hold", "0.6", "--rest", "0.8", "--decay", "8", "--seed", "1")


class Amplifier:
    """A stand that is pulled by hand, read as an amplifier on the network."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process
        assert process.stdout is not None
        self.port = json.loads(process.stdout.readline())["port"]

    def do(self, command: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{command}\n")
        self.process.stdin.flush()


@pytest.fixture
def home(tmp_path: Path) -> Path:
    for name in ("runs", "config"):
        (tmp_path / name).mkdir()
    return tmp_path


@pytest.fixture
def amplifier(home: Path) -> Iterator[Amplifier]:
    command = [sys.executable, "-m", "app", "device", "simulate", "--tcp", "0", "--json", "--on-demand", "--control"]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with running([*command, *QUICK], **pipes) as process:
        yield Amplifier(process)
        process.stdin.close()  # type: ignore[union-attr]
        process.stdout.close()  # type: ignore[union-attr]


def test_a_day_in_the_program(home: Path, amplifier: Amplifier) -> None:
    with window_system(home) as environment:
        with program(environment, home) as desk:
            first = first_result(desk, home)
            decide(desk, first)
            look_closely(desk)
            pull_by_hand(desk, amplifier, home)
            lose(desk, amplifier, home)
            review(desk, first, home)
            bring_a_file(desk, home)
            close_while_recording(desk, home)
        with program(environment, home) as desk:
            begin_again(desk, first)


def runs_of(home: Path) -> list[Path]:
    return sorted((home / "runs").glob("*.h5"))


def screen(desk: Desk, number: int) -> None:
    desk.press(f"ctrl+{number}")


def wait_for_result(desk: Desk) -> None:
    desk.wait(lambda: desk.focused() and desk.focused()["text"].startswith("Keep"), "the result")


def first_result(desk: Desk, home: Path) -> Path:
    """Enter alone leads from the first start to a result, and Esc before the pull keeps nothing."""
    assert desk.button("Try with the simulated stand")["primary"]
    desk.press("Return")
    desk.wait(lambda: desk.button("Arm")["primary"], "a stand that is ready")
    assert "SIMULATED" in desk.words()
    assert "free" in desk.words(), "the disk is told from the first second"
    desk.press("Return")
    desk.wait_for("The plate slides")
    desk.wait_for("Both move together")
    time.sleep(2.0)
    desk.press("Escape")
    wait_for_result(desk)
    (path,) = runs_of(home)
    return path


def decide(desk: Desk, first: Path) -> None:
    """Keep with a note, take it back, discard, take that back, and keep by a click."""
    desk.press("n")
    desk.write("first of the day")
    desk.press("Return")
    desk.wait_for(f"Kept {first.stem}")
    assert open_run(first, trusted=True).metadata.note == "first of the day"
    desk.press("ctrl+z")
    wait_for_result(desk)
    desk.press("d")
    desk.wait_for(f"Moved {first.stem} to the trash")
    assert not first.exists()
    desk.click("Undo")
    wait_for_result(desk)
    assert first.exists()


def look_closely(desk: Desk) -> None:
    """Zoom, move, fit and reset by wheel, box and keys; crosshair, and the picture in the clipboard."""
    before = desk.plots()[0]
    x, y = middle_of(before["place"])
    desk.click_at(before["place"], button=4, times=3)
    wheeled = desk.wait(lambda: changed(desk, before), "a zoom by the wheel")
    assert width(wheeled) == pytest.approx(0.8**3 * width(before), rel=0.01)
    assert desk.plots()[0]["readout"], "the crosshair reads the curve"
    desk.drag((x - 60, y - 40), (x + 60, y + 40))
    boxed = desk.wait(lambda: changed(desk, wheeled), "a zoom by a box")
    assert width(boxed) < 0.5 * width(wheeled)
    desk.drag((x, y), (x + 80, y), keys="shift")
    moved = desk.wait(lambda: changed(desk, boxed), "a move")
    assert width(moved) == pytest.approx(width(boxed), rel=1e-6)
    assert moved["x"][0] < boxed["x"][0]
    desk.press("Home")
    desk.wait(lambda: desk.plots()[0]["x"] == before["x"], "all of the record")
    desk.press("plus")
    desk.wait(lambda: changed(desk, before), "a zoom by a key")
    desk.click_at(before["place"], times=2)
    desk.wait(lambda: desk.plots()[0]["x"] == before["x"], "all of the record by a double click")
    desk.press("ctrl+c")
    desk.wait(lambda: desk.clipboard("image/png").startswith(b"\x89PNG"), "a picture")
    desk.click_at(before["place"], button=3)
    desk.choose("Reset")


def changed(desk: Desk, before: dict) -> dict | None:
    now = desk.plots()[0]
    return now if now["x"] != before["x"] else None


def width(plot: dict) -> float:
    return plot["x"][1] - plot["x"][0]
