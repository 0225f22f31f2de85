"""Each command on a page is one of the program; those without a device are run, and outputs compared."""

import contextlib
import copy
import io
import pickle
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.core import TyperGroup

from analysis.identify import Identification, identify
from analysis.record import Record
from app.cli.commands import app
from app.cli.errors import CommandError
from app.runs import analyze
from app.runs.analyze import Progress
from tools import page_commands
from tools.page_commands import COMPARED_ELSEWHERE, MADE, PAGES, PLACEHOLDER, ROOT, PageCommand, is_run

RUN_APART = {"docs/how-to/sign-a-report.md", "docs/how-to/make-figures.md"}
"""Pages whose commands draw for long: their first one is run."""
SHELL = {
    "cp", "dask", "make", "pip", "python", "py", "slipstand", "source", "sudo", "t=$(($(date",
    ".venv\\Scripts\\python", ".venv\\Scripts\\slipstand",
}  # fmt: skip
"""First words of the lines of blocks without a language."""


COMMANDS = [command for page in PAGES if page.name not in MADE for command in page_commands.commands_of(page)]


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
        if command.page == page and not command.is_python:
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
    page_commands.make_stage(folder)
    return folder


@pytest.fixture(scope="module")
def kept_identifications() -> Iterator[None]:
    """Identify each record once: pages do so with the same three runs again and again."""
    kept: dict[bytes, Identification] = {}

    def identify_once(record: Record, *, progress: Progress | None = None, **options: Any) -> Identification:
        key = pickle.dumps((record, options))
        if key not in kept:
            kept[key] = identify(record, progress=progress, **options)
        return copy.deepcopy(kept[key])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(analyze, "identify", identify_once)
        yield


@pytest.fixture(scope="module")
def printed_before() -> dict[tuple[str, ...], list[list[str]]]:
    """What commands printed: a page and its translations have the same ones."""
    return {}


def run_pages() -> list[str]:
    return sorted({command.page for command in COMMANDS if is_run(command)})


def printed_by(command: PageCommand, slipstand: Any) -> str:
    """What a command or a block of Python prints; it has to succeed."""
    if command.is_python:
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            exec(compile(command.line, command.page, "exec"), {"__name__": "__main__"})
        return said.getvalue()
    words = [
        file
        for word in command.words
        for file in (sorted(map(str, Path().glob(word))) if "*" in word else [word])
    ]
    outcome = slipstand(*words)
    assert outcome.code == 0, f"{command.page}: {command.line}: {outcome.err}"
    assert "error:" not in outcome.err
    return str(outcome.err + outcome.out)


@pytest.mark.parametrize("page", run_pages())
def test_commands_of_a_page_run_and_print_what_it_shows(
    page: str,
    stage: Path,
    slipstand: Any,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    kept_identifications: None,
    printed_before: dict[tuple[str, ...], list[list[str]]],
) -> None:
    """In their order, in a folder of their own, with the exit code of success and no word of a fault."""
    shutil.copytree(stage, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", page_commands.COLUMNS)
    monkeypatch.setenv("SLIPSTAND_RECORDINGS", str(tmp_path / "recordings"))
    monkeypatch.setenv("SLIPSTAND_CONFIG", str(tmp_path / "settings"))
    commands = [command for command in COMMANDS if command.page == page and is_run(command)]
    commands = commands[:1] if page in RUN_APART else commands
    lines = tuple(command.line for command in commands)
    if lines not in printed_before:
        printed_before[lines] = [printed_by(command, slipstand).splitlines() for command in commands]
    for command, printed in zip(commands, printed_before[lines], strict=True):
        for shown in command.shown:
            found = page_commands.faults(shown.lines, printed)
            assert found == [], f"{page}: {command.line}: run python -m tools.page_commands"


def test_every_shown_output_is_compared() -> None:
    """By the test above, or by the one that the list names."""
    for command in COMMANDS:
        if command.shown:
            assert is_run(command) or command.line in COMPARED_ELSEWHERE, f"{command.page}: {command.line}"
            assert command.page not in RUN_APART
    for reason in COMPARED_ELSEWHERE.values():
        test = reason.rpartition(": ")[2]
        assert "page_commands" in (ROOT / test).read_text("utf-8"), test
    assert {command.line for command in COMMANDS if command.shown} >= COMPARED_ELSEWHERE.keys()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_what_is_no_command_names_its_language(page: Path) -> None:
    """So that no output stands on a page without being compared, and no command without being run."""
    text = page.read_text("utf-8")
    for _, _, language, contents in page_commands.blocks(text):
        lines = contents.replace("\\\n", " ").splitlines()
        others = {line.split()[0] for line in lines if line.strip() and not line.lstrip().startswith("#")}
        assert language or others <= SHELL, (
            f"{page.name}: name the language of the block with {others - SHELL}"
        )
    assert not re.search(r"^    slipstand ", text, re.MULTILINE), "put commands into a block"


def test_a_page_that_shows_something_else_is_noticed() -> None:
    printed = [
        "wrote /tmp/one/a.h5",
        "f_d   0.10005 ± 0.00022",
        "T     320.01 ms",
        "",
        "slipstand 0.1.0 (abc123)",
    ]
    shown = ["wrote a.h5", "f_d 0.10006 ± 0.00022", "...", "slipstand 9.9.9 (def456)"]
    assert page_commands.faults(shown, printed) == []
    assert page_commands.faults(["wrote b.h5", "..."], printed) == ["not printed: 'wrote b.h5'"]
    assert page_commands.faults(["...", "f_d 0.10008 ± 0.00022", "..."], printed)
    assert page_commands.faults(["...", "T 320.01 s", "..."], printed)
    (fault,) = page_commands.faults(["...", "T 320.01 ms"], printed)
    assert fault.startswith("lines are left out at the end")
    (fault,) = page_commands.faults(["T 320.01 ms", "..."], printed)
    assert fault.startswith("lines are left out before")
    assert page_commands.faults(["f_d 0.2 ± 0.1"], printed, exactly=False) == []


def test_an_output_is_written_anew() -> None:
    text = "```output\nf_d 0.2\n...\n```\n"
    shown = page_commands.Shown(10, 22, "", ["f_d 0.2", "..."])
    assert page_commands.rewritten(text, shown, ["other", "f_d 0.1"]) == text.replace("0.2", "0.1")
    assert "\nother\nf_d 0.1\n```" in page_commands.rewritten(
        text, shown._replace(lines=[]), ["other", "f_d 0.1"]
    )
