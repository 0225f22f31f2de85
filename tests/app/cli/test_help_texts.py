"""`--help` of every command: whole sentences in the lists, and a unit for every number."""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from cli_kit import assert_one_error_line

from app.cli.result_options import FIGURE_FORMATS, FIGURES
from app.reports.figures import style
from app.reports.figures.plate_figures import ALL_FIGURES

LISTS = ((), ("calibrate",), ("device",))
COMMANDS = (
    "demo", "record", "analyze", "simulate", "plan", "import", "watch", "export", "table", "figures",
    "report", "runs", "recover", "edit", "trash", "audit", "doctor", "calibrate", "calibrate check",
    "device list", "device ports", "device probe", "device simulate", "device health",
)  # fmt: skip
UNIT = re.compile(
    r"\((m|m/s|mm|kg|s|Hz|kg/s|1/s|N/m|rad|ppm|%|degrees C|s since 1970|mm, or counts[^)]*)\)"
    r"|\b[Ss]econds\b|([Ss]amples|[Rr]ows) a second|in counts|\bMetres\b"
)
UNITS = {"M", "M/S", "MM", "KG", "S", "HZ", "KG/S", "1/S", "N/M", "RAD", "PPM", "PERCENT", "CELSIUS"}
PURE = re.compile(r"f_[ds]\b|friction coefficient|[Ff]raction|share|by this fraction|[Rr]elative standard")
"""Numbers that have no unit."""


@pytest.fixture(autouse=True)
def terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("TERMINAL_WIDTH", "80")


def options_of(text: str) -> dict[str, str]:
    """What is said of each option, with its kind before it."""
    found = re.findall(r"^  (?:-\w, )?(--[\w-]+)(.*(?:\n {4,}\S.*)*)", text, re.MULTILINE)
    return {name: " ".join(said.split()) for name, said in found}


@pytest.mark.parametrize("group", LISTS, ids=lambda group: "".join(group) or "slipstand")
def test_lists_of_commands_say_in_whole_sentences_what_they_do(
    slipstand: Any, group: tuple[str, ...]
) -> None:
    commands = slipstand(*group, "--help").out.split("Commands:\n")[1].partition("\n\n")[0]
    listed = commands.strip().splitlines()
    names = {" ".join((*group, line.split()[0])) for line in listed}

    assert names - {"device"} == {name for name in COMMANDS if name.split()[:-1] == list(group)}
    assert [line for line in listed if not re.search(r"[^.]\.$", line)] == []


@pytest.mark.parametrize("command", COMMANDS)
def test_every_number_has_its_unit(slipstand: Any, command: str) -> None:
    said = options_of(slipstand(*command.split(), "--help").out)
    pure = {name: text for name, text in said.items() if text.startswith("NUMBER")}
    with_unit = {name for name, text in said.items() if text.split(" ")[0] in UNITS}

    assert [name for name, text in pure.items() if not (UNIT.search(text) or PURE.search(text))] == []
    assert with_unit or command not in ("record", "simulate", "plan", "import", "device simulate")


@pytest.mark.parametrize("command", COMMANDS)
def test_values_are_called_by_what_they_are_and_not_by_a_python_type(slipstand: Any, command: str) -> None:
    text = slipstand(*command.split(), "-h").out
    assert re.findall(r"<[a-z%]|FLOAT|INTEGER|PATH\b|\.\.\.\.|\{", text) == []


@pytest.mark.parametrize(
    ("command", "shown"),
    [
        ("record", "--series CODE"),
        ("record", "--plate-mass KG"),
        ("runs", "--since DATE"),
        ("runs", "--until DATE"),
        ("analyze", "--until S"),
        ("calibrate", "--valid-until DATE"),
        ("report", "--date DATE"),
        ("import", "--table COLUMN"),
        ("analyze", "slipstand analyze [OPTIONS] RUN|FOLDER..."),
        ("runs", "slipstand runs [OPTIONS] [FOLDER]"),
    ],
)
def test_what_stands_for_a_value(slipstand: Any, command: str, shown: str) -> None:
    assert shown in " ".join(slipstand(command, "--help").out.split())


def test_short_help_is_that_of_every_command(slipstand: Any) -> None:
    for command in ((), ("device",), ("device", "list"), ("calibrate", "check")):
        assert slipstand(*command, "-h").out == slipstand(*command, "--help").out


def completed(words: str) -> list[str]:
    """What a shell gets for the last word of a command."""
    environment = {**os.environ, "_SLIPSTAND_COMPLETE": "complete_bash", "COMP_WORDS": words}
    environment["COMP_CWORD"] = str(len(words.split(" ")) - 1)
    command = [sys.executable, "-m", "slipstand"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    return done.stdout.split()


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("slipstand rec", ["record", "recover"]),
        ("slipstand device he", ["health"]),
        ("slipstand export --format pa", ["parquet"]),
        ("slipstand record --series 2SSM", ["2SSM0", "2SSM1", "2SSM2", "2SSM3"]),
        ("slipstand record --protocol gs", ["gsv", "gsv-234"]),
        ("slipstand runs --sinc", ["--since"]),
        ("slipstand figures --figure fd-", ["fd-velocity", "fd-position", "fd-time"]),
        ("slipstand figures --series 3SSM", ["3SSM0", "3SSM1", "3SSM2", "3SSM3"]),
        ("slipstand table --column f", ["friction_dynamic_plate"]),
        ("slipstand runs --columns run,s", ["run,series", "run,seconds", "run,source"]),
        ("slipstand demo --effect release-r", ["release-ramp="]),
    ],
)
def test_words_are_completed(words: str, expected: list[str]) -> None:
    assert completed(words) == expected


def test_figures_that_are_completed_are_those_that_are_drawn() -> None:
    assert ("2", *(figure.number for figure in ALL_FIGURES)) == FIGURES


def test_completion_is_installed_by_an_option(slipstand: Any) -> None:
    # the shell is named here; else the one that runs the tests is looked for
    environment = {**os.environ, "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    command = [sys.executable, "-m", "slipstand", "--show-completion", "bash"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    assert "_SLIPSTAND_COMPLETE" in done.stdout
    assert "--install-completion" in slipstand("--help").out


@pytest.mark.parametrize("command", COMMANDS)
def test_the_example_of_a_command_names_options_that_it_has(
    slipstand: Any, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TERMINAL_WIDTH", "300")
    monkeypatch.setenv("COLUMNS", "300")
    text, example = slipstand(*command.split(), "--help").out.split("Example:")
    known = {*options_of(text), "-o"}

    assert " ".join(example.split()).startswith(f"slipstand {command}")
    assert set(re.findall(r"(?<=\s)--?[a-z][a-z-]*", example)) <= known


def test_defaults_are_shown(slipstand: Any) -> None:
    shown = options_of(slipstand("simulate", "--help").out)

    assert shown["--rate"].endswith("Samples a second. [default: 1000.0]")
    assert "--no-control" not in slipstand("device", "simulate", "--help").out


def test_help_imports_only_the_options() -> None:
    code = (
        "import sys\n"
        "from app.cli.commands import CalibrateGroup, DeviceGroup, SlipstandGroup\n"
        "for group in (CalibrateGroup, DeviceGroup, SlipstandGroup):\n"
        "    for entry in group.entries:\n"
        "        entry.load()\n"
        "print(*sys.modules)"
    )
    loaded = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout

    assert not {"numpy", "scipy", "numba", "h5py", "matplotlib", "PySide6"} & set(loaded.split())


def test_formats_are_those_of_the_reports() -> None:
    assert FIGURE_FORMATS == style.FORMATS


REFERENCE = Path(__file__).resolve().parents[3] / "docs" / "reference" / "commands.md"


def reference_parts() -> list[tuple[tuple[str, ...], str]]:
    """Rows of the table and sections of the page on commands, each with the commands that it is about."""
    table, *sections = re.split(r"^## ", REFERENCE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    parts: list[tuple[tuple[str, ...], str]] = []
    for row in re.findall(r"^\| `slipstand (.*)$", table, re.MULTILINE):
        names = [name for name in COMMANDS if re.match(rf"{name}\b", row)]
        parts.append(((max(names, key=len),), row))
    for section in sections:
        heading, text = section.split("\n", 1)
        names = re.findall(r"`([a-z ]+?)(?: --campaign)?`", heading)
        parts.append((tuple(names), text if names else ""))
    return parts


def test_the_reference_lists_every_command() -> None:
    assert {name for names, _ in reference_parts() for name in names} == set(COMMANDS)


@pytest.mark.parametrize(("commands", "text"), reference_parts())
def test_the_reference_names_only_options_that_there_are(
    slipstand: Any, commands: tuple[str, ...], text: str
) -> None:
    known = {"--help"}.union(*(options_of(slipstand(*name.split(), "--help").out) for name in commands))

    assert set(re.findall(r"`(--[a-z][a-z0-9-]*)", text)) <= known


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("device", "simulate", "--rest", 0), "--rest 0 is out of range: give 0.05 to 3600"),
        (("device", "simulate", "--lag", 9), "--lag 9 is out of range: give -1 to 1"),
        (("demo", "--campaign", "--repeats", 0), "--repeats 0 is out of range: give 1 to 1000"),
        (("demo", "--campaign", "--scatter", 1), "--scatter 1 is out of range: give 0 to 0.3"),
    ],
)
def test_a_value_out_of_range_is_named_by_its_option(
    slipstand: Any, arguments: tuple[object, ...], said: str
) -> None:
    assert_one_error_line(slipstand(*arguments), said)


def test_a_terminal_without_the_sign_is_shown_its_spelling() -> None:
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    code = "import sys; from app.cli import _use_utf8; _use_utf8(sys.stdout);"
    code += "print('0.1 \\xb1 0.2 \\xb5m\\xb2 \\udcff \\u0431')"
    shown = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment
    )
    assert shown.stdout == "0.1 +- 0.2 um^2 \\udcff \\u0431\n"
