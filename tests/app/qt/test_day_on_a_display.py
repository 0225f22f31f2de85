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
from tests.waiting import PATIENCE_S

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="Xvfb is a window system of Linux"),
    pytest.mark.skipif(bool(missing_programs()), reason=f"not installed: {', '.join(missing_programs())}"),
]

QUICK = (
    "--protocol",
    "csv",
    "--pull",
    "0.5",
    "--hold",
    "0.6",
    "--rest",
    "0.8",
    "--decay",
    "8",
    "--seed",
    "1",
)


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
    command = [
        sys.executable,
        "-m",
        "app",
        "device",
        "simulate",
        "--tcp",
        "0",
        "--json",
        "--on-demand",
        "--control",
    ]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with running([*command, *QUICK], **pipes) as process:
        yield Amplifier(process)
        process.stdin.close()  # type: ignore[union-attr]
        process.stdout.close()  # type: ignore[union-attr]


@pytest.mark.timeout(1800)
def test_a_day_in_the_program(home: Path, amplifier: Amplifier) -> None:
    with window_system(home) as environment:
        with program(environment, home) as desk:
            first = first_result(desk, home)
            decide(desk, first)
            look_closely(desk)
            pull_by_hand(desk, amplifier, home)
            lose(desk, amplifier)
            review(desk, first, home)
            bring_a_file(desk, home)
            close_while_recording(desk, home)
        with program(environment, home) as desk:
            begin_again(desk, first)


def runs_of(home: Path) -> list[Path]:
    return sorted((home / "runs").glob("*.h5"))


def screen(desk: Desk, number: int) -> None:
    desk.wait(
        lambda: any(one["is_active"] and "MainWindow" in one["kind"] for one in desk.look()),
        "the window in front of its dialogs",
    )
    desk.press(f"ctrl+{number}")


def wait_for_result(desk: Desk) -> None:
    desk.wait(lambda: desk.focused() and desk.focused()["text"].startswith("Keep"), "the result")


def first_result(desk: Desk, home: Path) -> Path:
    """Enter alone leads from the first start to a result."""
    assert desk.button("Try with the simulated stand")["primary"]
    desk.press("Return")
    desk.wait(lambda: desk.button("Arm")["primary"], "a stand that is ready")
    assert "SIMULATED" in desk.words()
    desk.wait_for(" free")
    desk.press("Return")
    wait_for_result(desk)
    (path,) = runs_of(home)
    return path


def decide(desk: Desk, first: Path) -> None:
    """Plan two tests; keep with a note, take it back, discard, and take that back by a click."""
    desk.press("p")
    desk.wait_for_field("QDialog")
    desk.write("1FFM0 x2")
    desk.press("Return")
    desk.click("Simulated runs count")
    desk.press("Escape")
    desk.wait_for("Plan 0/2")
    desk.press("n")
    desk.write("first of the day")
    desk.press("Return")
    desk.wait_for(f"Kept {first.stem}")
    assert open_run(first, trusted=True).metadata.note == "first of the day"
    desk.wait_for("Plan 1/2")
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
    desk.choose("Fit height")
    desk.press("Home")


def pull_by_hand(desk: Desk, amplifier: Amplifier, home: Path) -> None:
    """Another device leaves a run undecided; Esc before the pull keeps nothing; an early release is told."""
    screen(desk, 1)
    fill_in(desk, "Port", amplifier.port, "QComboBox")
    desk.press("Tab")
    desk.write("csv")
    desk.press("Tab", "Return")
    desk.button("Arm")
    assert desk.focused()["text"].startswith("Keep")
    (first,) = runs_of(home)
    desk.press("a")
    desk.wait_for(f"Decide about {first.stem} first")
    assert "Plan 0/2" in desk.words()
    desk.press("Return")
    desk.wait_for(f"Kept {first.stem}", "Plan 1/2")
    desk.press("a")
    desk.wait_for("Pull the table back")
    desk.press("Escape")
    desk.wait_for("Disarmed. Nothing was recorded")
    assert runs_of(home) == [first]
    desk.press("a")
    desk.wait_for("Pull the table back")
    amplifier.do("early")
    amplifier.do("pull")
    desk.wait_for("Let go too early, at")
    time.sleep(3.0)
    amplifier.do("pull")
    wait_for_result(desk)
    desk.press("Return")
    desk.wait_for("Kept ", "Plan 2/2")
    keep_the_amplifier(desk)


def fill_in(desk: Desk, name: str, text: str, kind: str = "QLineEdit") -> None:
    place = desk.find(name, kind)["place"]
    desk.click_at((*place[:2], place[2] // 2, place[3]))  # left of the arrow of a list
    desk.press("ctrl+a")
    desk.write(text)


def keep_the_amplifier(desk: Desk) -> None:
    """Space on Start does not put the simulated stand in its place."""
    screen(desk, 1)
    desk.tab_to("Try with")
    desk.press("space")
    desk.wait_for("The simulated stand would take its place")
    desk.press("space")
    desk.wait_until_gone("The simulated stand would take its place")
    desk.wait_for("Connected: ")


def lose(desk: Desk, amplifier: Amplifier) -> None:
    """All that a lost device showed is dated, on Record and on Gauges."""
    screen(desk, 2)
    amplifier.process.kill()
    desk.wait(lambda: "device lost" in desk.title(), "the loss in the title")
    desk.wait_for("Plug the device in again", "CSV lines lost", "\nat ")
    screen(desk, 6)
    desk.wait_for("No sample has come since")


def review(desk: Desk, first: Path, home: Path) -> None:
    """Copy rows, newest first, put the first run aside and bring it back, open it, and write its report."""
    screen(desk, 4)
    desk.wait(lambda: len(desk.rows()) == 2, "both runs")
    desk.click_at(desk.rows()[0]["place"])
    desk.press("shift+Down", "ctrl+c")
    lines = desk.wait(lambda: desk.clipboard().decode().splitlines(), "copied rows")
    assert [len(line.split("\t")) for line in lines] == [len(lines[0].split("\t"))] * 3
    desk.click_at(desk.rows()[1]["place"])
    desk.press("Delete")
    desk.wait(lambda: len(desk.rows()) == 1, "a run less")
    assert not first.exists()
    desk.click("Show trash")
    desk.wait_for("Trash: 1 run")
    desk.click_at(desk.wait(desk.rows, "the run in the trash")[0]["place"])
    desk.click("Restore")
    desk.wait(first.exists, "the run")
    desk.press("ctrl+t")
    desk.wait(lambda: len(desk.rows()) == 2, "both runs")
    desk.click_at(desk.rows()[1]["place"], times=2)
    desk.wait(lambda: desk.title().startswith(f"{first.stem} "), "the run in the title")
    law = open_run(first).analyses[-1].document["model"]["name"]  # which one is left to the noise
    desk.wait_for(f"{law.capitalize()} explains the record", "Model fits")
    desk.click("Export")
    desk.choose("Report as PDF…")
    desk.wait_for_field("QFileDialog")
    desk.press("Return")
    report = first.with_suffix(".pdf")
    desk.wait_for(f"Wrote {report}")
    assert report.read_bytes().startswith(b"%PDF")
    assert "QAbstractButton" not in desk.focused()["kind"], "Enter would press what nobody chose"


def changed(desk: Desk, before: dict) -> dict | None:
    now = desk.plots()[0]
    return now if now["x"] != before["x"] else None


def width(plot: dict) -> float:
    return plot["x"][1] - plot["x"][0]


def bring_a_file(desk: Desk, home: Path) -> None:
    """Import a text in UTF-16 with a decimal comma, units below the names, and empty last columns."""
    source = open_run(runs_of(home)[0], trusted=True)
    assert source.relative_reading is not None
    columns = (source.time_s, source.table_reading, source.relative_reading)
    lines = ["Zeit;Tisch;Platte;;", "s;mm;mm;;"]
    lines += [
        f"{t:.4f};{u * 1e3:.5f};{v * 1e3:.5f};;".replace(".", ",")
        for t, u, v in zip(*(column[::4] for column in columns), strict=True)
    ]
    text = home / "odd.csv"
    text.write_text("\n".join(lines), encoding="utf-16")
    screen(desk, 4)
    desk.press("ctrl+i")
    desk.wait_for_field("QFileDialog")
    desk.write(str(text))
    desk.press("Return")
    desk.wait_for("Zeit;Tisch;Platte")
    before = len(runs_of(home))
    desk.wait(lambda: desk.button("Import")["text"] == "Import", "a file that can be imported")
    desk.click("Import")
    desk.wait(lambda: len(runs_of(home)) > before, "the imported run")
    desk.press("Escape")


def close_while_recording(desk: Desk, home: Path) -> None:
    """Closing the window by the window manager asks, and what is recorded becomes a run."""
    before = len(runs_of(home))
    screen(desk, 1)
    desk.click("Try with the simulated stand")
    desk.click("Start the simulated stand")
    desk.wait(lambda: desk.button("Arm")["primary"], "a stand that is ready")
    desk.click("Arm")
    released = ("The plate slides", "Both move together")
    desk.wait(lambda: any(words in desk.words() for words in released), "the release")
    desk.press("alt+F4")
    desk.wait_for("Closing the window")
    desk.press("Return")
    desk.wait_until_gone("Closing the window")
    desk.press("alt+F4")
    desk.click("Close the window")
    assert desk.process.wait(PATIENCE_S) == 0
    assert len(runs_of(home)) == before + 1


def begin_again(desk: Desk, first: Path) -> None:
    """The next start offers the last device and recent runs, and a run is opened by a click."""
    screen(desk, 1)
    assert desk.button("Connect again")["primary"]
    desk.click(f"Open {first.stem}")
    desk.wait(lambda: desk.title().startswith(f"{first.stem} "), "the run in the title")
    desk.press("ctrl+q")
    assert desk.process.wait(PATIENCE_S) == 0
