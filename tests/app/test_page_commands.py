"""Each command on a page is one of the program; those that need no device are run as they stand."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import typer
from reports_kit import write_run
from typer.core import TyperGroup

from analysis.synthetic import Truth, simulate_readings
from app.cli.commands import app
from app.cli.errors import CommandError

ROOT = Path(__file__).resolve().parents[2]
MADE = {"options.md", "configuration.md"}  # from the program itself
PAGES = [
    *(page for page in sorted((ROOT / "docs").rglob("*.md")) if not {"_outside", "_build"} & {*page.parts}),
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "firmware/README.md", "recordings/README.md")),
]
FENCE = re.compile(r"^ *```.*?\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"`(slipstand [^`]+)`")
PLACEHOLDER = re.compile(r"\[?[A-Z][A-Z.|\\/-]*(\.h5|\.csv)?\]?(\.\.\.)?")
NO_DEVICE = {
    "analyze", "audit", "doctor", "edit", "export", "figures", "import", "plan", "recover", "report", "runs",
    "simulate", "table", "trash",
}  # fmt: skip
"""Commands that are run. Others need a device, a display or no end; `device list` is run too."""
NOT_RUN = {
    "slipstand import *.csv --table u1 -o runs/",
    "slipstand analyze bare.h5 loaded.h5 --kind one-mass --added-mass 20 --added-mass-uncertainty 0.01",
}
"""Of other files than the stage has; tests of the commands run them."""
RUN_APART = {"docs/how-to/sign-a-report.md", "docs/how-to/make-figures.md"}
"""Pages whose commands draw for long: their first one is run."""


class PageCommand(NamedTuple):
    page: str
    line: str
    is_fenced: bool

    @property
    def words(self) -> list[str]:
        return shlex.split(self.line.replace("\\|", "|"), comments=True)[1:]

    @property
    def is_run(self) -> bool:
        """Whether it needs no device and has values in all its places."""
        words = self.words
        is_complete = not any(word == "..." or PLACEHOLDER.fullmatch(word) for word in words)
        is_whole = self.is_fenced or "--series" in words or any("." in word or "/" in word for word in words)
        by_itself = words in (["device", "list"], ["runs"], ["doctor"], ["audit"], ["recover"])
        return (
            is_complete and self.line not in NOT_RUN and ((words[0] in NO_DEVICE and is_whole) or by_itself)
        )


def page_commands() -> Iterator[PageCommand]:
    """Commands of fenced blocks and of inline code, in the order of each page."""
    for page in PAGES:
        if page.name in MADE:
            continue
        name, text = page.relative_to(ROOT).as_posix(), page.read_text("utf-8")
        places = [
            (block.start(), line.strip(), True)
            for block in FENCE.finditer(text)
            for line in block[1].replace("\\\n", " ").splitlines()
            if line.strip().startswith("slipstand ")
        ]
        plain = FENCE.sub(lambda block: " " * len(block[0]), text)
        places += [(found.start(), found[1], False) for found in INLINE.finditer(plain)]
        for _, line, is_fenced in sorted(places, key=lambda place: place[0]):
            yield PageCommand(name, " ".join(line.split()).removesuffix(" &"), is_fenced)


COMMANDS = list(page_commands())


def value_for(param: Any, word: str) -> str:
    """The value that a page gives, or one that the option takes where the page has a placeholder."""
    metavar = str(param.metavar)
    if not (PLACEHOLDER.fullmatch(word) or word.startswith("$") or f"[{word}]" == metavar):
        return word
    if metavar.startswith("["):
        return metavar.strip("[]").split("|")[0]
    return {"DATE": "2026-11-21"}.get(metavar, "1")


def parse(words: list[str]) -> None:
    """Parse a command as the program does, without its required options. Raises UsageError, CommandError."""
    command: Any = typer.main.get_command(app)
    context = typer.Context(command, info_name="slipstand")
    words = [word for word in words if word not in ("...", "--verbose", "-h", "--help")]
    if words in (["RUN.h5"], ["--simulated"], ["COMMAND"], ["--install-completion"]):
        return  # opens the window; stands for any; changes the shell
    while isinstance(command, TyperGroup) and words and command.get_command(context, words[0]):
        command = command.get_command(context, words.pop(0))
        context = typer.Context(command, info_name=command.name, parent=context)
    options = {name: param for param in command.params for name in param.opts}
    for param in command.params:
        param.required = False
    previous = None
    for place, word in enumerate(words):
        if previous is not None:
            words[place] = value_for(previous, word)
            previous = None
        elif word.startswith("-"):
            assert word in options, f"{word} is no option of {context.command_path}"
            previous = None if getattr(options[word], "is_flag", False) else options[word]
    assert not (isinstance(command, TyperGroup) and words and not words[0].startswith("-")), words
    if previous is None:  # else it is named without its value
        command.make_context(context.info_name, words, parent=context.parent)


@pytest.mark.parametrize("page", sorted({command.page for command in COMMANDS}))
def test_commands_of_a_page_are_those_of_the_program(page: str) -> None:
    for command in COMMANDS:
        if command.page == page:
            try:
                parse(command.words)
            except (CommandError, typer.BadParameter, ValueError) as error:
                pytest.fail(f"{page}: {command.line}: {error}")


def test_a_command_that_is_none_is_noticed() -> None:
    for line, fault in (
        ("simulate --serie 1FFM0", AssertionError),
        ("analyse run.h5", AssertionError),
        ("export run.h5 --format doc", CommandError),
        ("plan --rate fast", typer.BadParameter),
    ):
        with pytest.raises(fault):
            parse(line.split())


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files that pages name."""
    folder = tmp_path_factory.mktemp("stage")
    (folder / "recordings").mkdir()
    for name, series in (
        ("20261121T141210_1FFM0_003", "1FFM0"),
        ("20261121T141410_1SSM0_001", "1SSM0"),
        ("20261121T141610_1SSLM0_001", "1SSLM0"),
    ):
        write_run(folder / "recordings" / f"{name}.h5", series)
    times = zip(*simulate_readings(Truth(rate_hz=200.0)), strict=True)
    rows = np.array(list(times)) * [1.0, 1e3, 1e3]
    np.savetxt(folder / "test.csv", rows, "%.6f", ",", header="t,u1,rel", comments="")
    return folder


def run_pages() -> list[str]:
    return sorted({command.page for command in COMMANDS if command.is_run})


@pytest.mark.parametrize("page", run_pages())
def test_commands_of_a_page_run(
    page: str, stage: Path, slipstand: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In their order, in a folder of their own, with the exit code of success and no word of a fault."""
    for name in ("recordings", "test.csv"):
        source = stage / name
        for file in [source] if source.is_file() else sorted(source.iterdir()):
            place = tmp_path / file.relative_to(stage)
            place.parent.mkdir(exist_ok=True)
            place.write_bytes(file.read_bytes())
    (tmp_path / "run.h5").write_bytes(next((tmp_path / "recordings").glob("*1FFM0*")).read_bytes())
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SLIPSTAND_RECORDINGS", str(tmp_path / "recordings"))
    monkeypatch.setenv("SLIPSTAND_CONFIG", str(tmp_path / "settings"))
    commands = [command for command in COMMANDS if command.page == page and command.is_run]
    for command in commands[:1] if page in RUN_APART else commands:
        words = [
            file
            for word in command.words
            for file in (sorted(map(str, Path().glob(word))) if "*" in word else [word])
        ]
        outcome = slipstand(*words)
        assert outcome.code == 0, f"{page}: {command.line}: {outcome.err}"
        assert "error:" not in outcome.err
