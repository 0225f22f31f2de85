"""Commands of the pages, and what they print: `python -m tools.page_commands` writes the shown outputs anew.

A block `output` of a page shows what the command or Python block above it prints: its lines on stderr, then
those on stdout, in that order. A line `...` stands for lines that are left out. A block without a language
holds commands alone. A test runs the commands of each page on the files of `make_stage` and compares.

What must differ is taken out of both sides by `normalise`: dates and times, folders, version and commit,
hashes, and blanks between columns. Numbers may differ by one of their last digit, since systems round
differently.
"""

import contextlib
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from analysis.synthetic import Truth, simulate_readings
from app.runs.metadata import RunSource, create_metadata
from app.runs.simulated import store_motion
from config.files import load_gauges, load_stand, published_row

ROOT = Path(__file__).resolve().parent.parent
MADE = {"options.md", "configuration.md"}  # from the program itself
PAGES = [
    *(page for page in sorted((ROOT / "docs").rglob("*.md")) if not {"_outside", "_build"} & {*page.parts}),
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "firmware/README.md", "recordings/README.md")),
]
COLUMNS: Final = "200"
"""Of the terminal, where lines are not broken."""
COMPARED_ELSEWHERE: Final = {
    "slipstand demo": "takes ten seconds in real time: tests/app/cli/test_demo_command.py",
    "slipstand device probe": "names a USB adapter: tests/app/cli/test_probe_command.py",
    "slipstand device health --port /dev/ttyACM0 --protocol csv": (
        "needs a device, five seconds in real time: tests/app/cli/test_health_command.py"
    ),
    "slipstand table real-stand": (
        "needs runs with a second mode, half a minute: tests/app/cli/test_table_of_real_stands.py"
    ),
    "slipstand plan --series 1FFM0 --last-runs real-stand": "the same: tests/app/cli/test_plan_command.py",
}
"""Commands whose shown output the test of the pages does not compare, with the reason and who does."""
PLACEHOLDER = re.compile(r"\[?[A-Z][A-Z.|\\/-]*(\.h5|\.csv)?\]?(\.\.\.)?")
NO_DEVICE = {
    "analyze", "audit", "doctor", "edit", "export", "figures", "import", "plan", "recover", "report", "runs",
    "simulate", "table", "trash",
}  # fmt: skip
"""Commands that are run. Others need a device, a display or no end; `device list` is run too."""
NOT_RUN = {
    "slipstand import *.csv --table u1 -o runs/",
    "slipstand analyze bare.h5 loaded.h5 --kind one-mass --added-mass 20 --added-mass-uncertainty 0.01",
    "slipstand table /net/recordings --dask tcp://lab-server:8786",
}
"""Of other files than the stage has, or on a cluster; tests of the commands run them."""
_BLOCK = re.compile(r"^( *)```([\w{}-]*)[^\n]*\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
_INLINE = re.compile(r"`(slipstand [^`]+)`")
_NUMBER = re.compile(r"(?<![\w.])[-+−]?\d+(?:\.\d+)?(?:e[-+]\d+)?")
_VARYING = (
    (re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?(\.\d+)?([+-]\d\d:\d\d|Z)?"), "DATE"),
    (re.compile(r"\b\d{8}T\d{6}"), "DATE"),
    (re.compile(r"\\"), "/"),
    (re.compile(r"(?<!\w)(\.\.\.|[A-Za-z]:)?/([^\s'\":]*/)?"), ""),  # folders
    (re.compile(r"slipstand \d+\.\d+\.\S+( \([0-9a-f]+(-dirty)?\))?"), "VERSION"),
    (re.compile(r"\b[0-9a-f]{16,64}\b"), "HASH"),
    (re.compile(r"\s+"), " "),
)


class Shown(NamedTuple):
    """Output that a page shows, with the place of its lines in the text of the page."""

    start: int
    end: int
    indent: str
    lines: list[str]


class PageCommand(NamedTuple):
    """A command on a page, or a block of Python."""

    page: str
    line: str
    is_fenced: bool
    shown: tuple[Shown, ...] = ()
    is_python: bool = False

    @property
    def words(self) -> list[str]:
        """Arguments, without what a shell does with the output."""
        words = shlex.split(self.line.replace("\\|", "|"), comments=True)[1:]
        return words[: words.index(">")] if ">" in words else words


def blocks(text: str) -> Iterator[tuple[int, str, str, str]]:
    """Fenced blocks of a page: start of the contents, indent, language and contents."""
    for block in _BLOCK.finditer(text):
        yield block.start(3), block[1], block[2], block[3]


def commands_of(page: Path) -> Iterator[PageCommand]:
    """Commands in blocks and in inline code, and Python with output, in their order."""
    name, text = page.relative_to(ROOT).as_posix(), page.read_text("utf-8")
    places: list[tuple[int, str, bool, bool]] = []
    shown: dict[int, Shown] = {}
    for start, indent, language, contents in blocks(text):
        if language == "output":
            lines = [line.removeprefix(indent) for line in contents.splitlines()]
            shown[start] = Shown(start, start + len(contents), indent, lines)
        elif language == "python":
            places.append((start, contents, True, True))
        else:
            joined = contents.replace("\\\n", " ").splitlines()
            lines = [line.strip() for line in joined if line.strip().startswith("slipstand ")]
            places += [(start, line, True, False) for line in lines]
    plain = _BLOCK.sub(lambda block: " " * len(block[0]), text)
    places += [(found.start(), found[1], False, False) for found in _INLINE.finditer(plain)]
    places.sort(key=lambda place: place[0])
    owners: dict[int, int] = {}
    for at in shown:
        above = [number for number, place in enumerate(places) if place[0] < at]
        listed = [number for number in above if _may_show(places[number])]
        owners[at] = listed[-1]
    for number, (_, text_of_it, is_fenced, is_python) in enumerate(places):
        below = tuple(shown[at] for at in sorted(shown) if owners[at] == number)
        line = text_of_it if is_python else " ".join(text_of_it.split()).removesuffix(" &")
        if not is_python or below:
            yield PageCommand(name, line, is_fenced, below, is_python)


def is_run(command: PageCommand) -> bool:
    """Whether a command needs no device and has values in all its places."""
    if command.is_python:
        return True
    words = command.words
    is_complete = not any(word == "..." or PLACEHOLDER.fullmatch(word) for word in words)
    is_whole = command.is_fenced or "--series" in words or any("." in word or "/" in word for word in words)
    by_itself = words in (["device", "list"], ["runs"], ["doctor"], ["audit"], ["recover"])
    left_out = command.line in NOT_RUN or command.line in COMPARED_ELSEWHERE
    return is_complete and not left_out and ((words[0] in NO_DEVICE and is_whole) or by_itself)


def _may_show(place: tuple[int, str, bool, bool]) -> bool:
    """Whether output below is that of the place: it is a block, or a command of the list."""
    return place[2] or place[1] in COMPARED_ELSEWHERE


def shown_lines(line: str) -> list[str]:
    """Lines of the output that pages in English show below a command of `COMPARED_ELSEWHERE`."""
    pages = [page for page in PAGES if page.name not in MADE and page.parent.name not in ("ru", "uz")]
    commands = [command for page in pages for command in commands_of(page) if command.line == line]
    return [text for command in commands for shown in command.shown for text in shown.lines]


def normalise(line: str) -> str:
    """A line without what differs from run to run and from system to system."""
    for pattern, replacement in _VARYING:
        line = pattern.sub(replacement, line)
    return line.strip()


def _shape(line: str) -> str:
    return _NUMBER.sub("0", normalise(line))


def is_alike(shown: str, printed: str) -> bool:
    """Whether lines agree; each number to one of its last digit."""
    if _shape(shown) != _shape(printed):
        return False
    pairs = zip(_NUMBER.findall(normalise(shown)), _NUMBER.findall(normalise(printed)), strict=True)
    return all(one == other or _is_near(one, other) for one, other in pairs)


def _is_near(one: str, other: str) -> bool:
    digits, _, exponent = one.replace("−", "-").partition("e")
    step = 10.0 ** (int(exponent or 0) - len(digits.partition(".")[2]))
    return abs(float(one.replace("−", "-")) - float(other.replace("−", "-"))) < 1.5 * step


def faults(shown: list[str], printed: list[str], *, exactly: bool = True) -> list[str]:
    """Lines of a block that are not printed in that order, and places where `...` is missing.

    Without `exactly` numbers are not compared, and lines may be left out anywhere.
    """
    found, at, may_skip = [], 0, not exactly
    for line in shown:
        if line.strip() == "...":
            may_skip = True
            continue
        agrees = [
            place
            for place in range(at, len(printed))
            if (is_alike(line, printed[place]) if exactly else _shape(line) == _shape(printed[place]))
        ]
        if not agrees:
            found.append(f"not printed: {line!r}")
        elif agrees[0] != at and not may_skip:
            found.append(f"lines are left out before {line!r}: mark them by ...")
        at, may_skip = (agrees[0] + 1 if agrees else at), not exactly
    if not may_skip and any(line.strip() for line in printed[at:]):
        found.append(f"lines are left out at the end, the first is {printed[at]!r}")
    return found


def make_stage(folder: Path) -> None:
    """Write the files that pages name: runs of noisy simulated tests, and a record of another program."""
    recordings = folder / "recordings"
    recordings.mkdir()
    for name, series in (
        ("20261121T141210_1FFM0_003", "1FFM0"),
        ("20261121T141410_1SSM0_001", "1SSM0"),
        ("20261121T141610_1SSLM0_001", "1SSLM0"),
    ):
        _write_run(recordings / f"{name}.h5", series)
    shutil.copy(recordings / "20261121T141210_1FFM0_003.h5", folder / "run.h5")
    times = zip(*simulate_readings(Truth(rate_hz=200.0)), strict=True)
    rows = np.array(list(times)) * [1.0, 1e3, 1e3]
    np.savetxt(folder / "test.csv", rows, "%.6f", ",", header="t,u1,rel", comments="")


def _write_run(path: Path, series: str) -> None:
    row, stand = published_row(series), load_stand()
    truth = Truth(
        period_s=row.period_s,
        damping_n1_per_s=row.damping_n1_per_s,
        plate_mass_kg=stand.series(series).plate_mass_kg,
        friction_dynamic=row.friction_dynamic,
        pullback_m=stand.series(series).pullback_m,
        rate_hz=250.0,
        duration_s=6.0,
    )
    _, table, relative = simulate_readings(truth)
    metadata = create_metadata(
        stand, load_gauges(), datetime.strptime(path.name[:15], "%Y%m%dT%H%M%S").replace(tzinfo=UTC),
        series=series, rate_hz=truth.rate_hz, source="simulated", stated_source=RunSource.SIMULATED,
    )  # fmt: skip
    readings = np.column_stack([table, relative])
    store_motion(path, metadata, readings, release_s=truth.hold_s, rate_hz=truth.rate_hz)


def rewritten(text: str, shown: Shown, printed: list[str]) -> str:
    """Text of a page with the lines of a block as they are printed now; an empty block gets all of them."""
    at, lines = 0, []
    for line in shown.lines or printed:
        places = [place for place in range(at, len(printed)) if _shape(printed[place]) == _shape(line)]
        at = places[0] + 1 if places else at
        lines.append(printed[places[0]] if places else line)
    contents = "".join(f"{shown.indent}{line}".rstrip() + "\n" for line in lines)
    return text[: shown.start] + contents + text[shown.end :]


def main(run: Callable[[list[str], Path], list[str]]) -> None:
    """Write the outputs of all pages anew, and name the lines that are no longer printed."""
    for page in PAGES:
        commands = [] if page.name in MADE else list(commands_of(page))
        places: list[tuple[Shown, list[str]]] = []
        is_shown = any(one.shown and is_run(one) for one in commands)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name).resolve()
            if is_shown:
                make_stage(folder)
            for one in filter(is_run, commands if is_shown else ()):
                printed = run(["-c", one.line] if one.is_python else ["-m", "app", *one.words], folder)
                places += [(shown, printed) for shown in one.shown]
        text = page.read_text("utf-8")
        for shown, printed in reversed(places):
            for fault in faults(shown.lines, printed) if shown.lines else ():
                sys.stderr.write(f"{page.relative_to(ROOT)}: {fault}\n")
            text = rewritten(text, shown, printed)
        if places:
            page.write_text(text, "utf-8")


def _run(words: list[str], folder: Path) -> list[str]:
    """Lines that Python prints in a folder of its own, without its path."""
    known = os.environ | {"PYTHONPATH": str(ROOT), "SLIPSTAND_RECORDINGS": str(folder / "recordings")}
    known |= {"SLIPSTAND_CONFIG": str(folder / "settings"), "PYTHONIOENCODING": "utf-8", "COLUMNS": COLUMNS}
    done = subprocess.run(
        [sys.executable, *words], cwd=folder, env=known, capture_output=True, text=True, encoding="utf-8",
        check=False,
    )  # fmt: skip
    return (done.stderr + done.stdout).replace(f"{folder}{os.sep}", "").splitlines()


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        main(_run)
