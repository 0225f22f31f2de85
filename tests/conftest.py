"""Shared by all tests: no window system is needed, and warnings are errors (pyproject.toml)."""

import gc
import json
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import hypothesis
import pytest
from schema_kit import check_output

from app.__main__ import main
from app.child import ONE_THREAD
from messages import i18n

hypothesis.settings.register_profile("house", deadline=None)  # a busy machine is slow, and not wrong
hypothesis.settings.load_profile("house")
os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ["SLIPSTAND_LOGS"] = tempfile.mkdtemp(prefix="slipstand-logs-")
for _name, _count in ONE_THREAD.items():
    os.environ.setdefault(_name, _count)

# Tests that follow a stand in real time want the machine for themselves: `make test` runs them last.
REALTIME_FILES = {
    "test_demo_command.py",
    "test_record_command.py",
    "test_record_amplifiers.py",
    "test_record_pair.py",
    "test_engine.py",
    "test_engine_ends.py",
    "test_engine_killed.py",
    "test_kill_drill.py",
    "test_engine_repeats.py",
    "test_live_stream.py",
    "test_unplug_drill.py",
    "test_disk_full_drill.py",
    "test_power_loss_drill.py",
    "test_two_engines.py",
    "test_live_recording.py",
    "test_stand_process.py",
    "test_whole_flow.py",
    "test_day_by_keys.py",
    "test_day_on_a_display.py",
    "test_firmware_record.py",
}

# Files that take longest come first, so that no worker has one left when the others are done.
LONGEST_FILES = (
    "test_day_on_a_display.py",
    "test_day_by_keys.py",
    "test_record_pair.py",
    "test_record_amplifiers.py",
    "test_wheel.py",
    "test_page_commands.py",
    "test_short_studies.py",
    "test_odd_records.py",
    "test_identify_one_mass.py",
    "test_test_report.py",
    "test_public_package.py",
    "test_real_stand.py",
    "test_recovery.py",
    "test_identify_screen.py",
    "test_two_mass.py",
    "test_degenerate_records.py",
    "test_keyboard.py",
    "test_stand_search.py",
    "test_pullback.py",
    "test_documentation.py",
    "test_interrupts.py",
    "test_foreign_text.py",
    "test_watch_command.py",
    "test_port_probe_simulated.py",
    "test_record_decisions.py",
    "test_saved_analyses.py",
    "test_doctor_command.py",
    "test_worker.py",
    "test_run_window.py",
)


@pytest.fixture
def use_language() -> Iterator[Callable[[str], None]]:
    """Choose the language of the window; English again after the test."""
    yield i18n.use_language
    i18n.use_language(i18n.ENGLISH)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Import no other file for the tests in real time: three workers would each do it, for half a minute."""
    is_test = collection_path.name.startswith("test_") and collection_path.suffix == ".py"
    is_left_out = is_test and collection_path.name not in REALTIME_FILES
    return True if is_left_out and config.getoption("markexpr") == "realtime" else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what runs in real time, and what meets a program that is not ours: `make peers` runs these.

    Order the files for workers that are each given one after the other.
    """
    ranks = {name: rank for rank, name in enumerate(LONGEST_FILES)}
    items.sort(key=lambda item: ranks.get(item.path.name, len(ranks)))
    for item in items:
        if item.path.name in REALTIME_FILES:
            item.add_marker(pytest.mark.realtime)
        if "_peer" in item.path.stem or item.path.parent.name == "firmware":
            item.add_marker(pytest.mark.peer)


def pytest_collection_finish() -> None:
    """Let garbage collections pass over what imports and collected tests hold: most of all objects."""
    gc.collect()
    gc.freeze()


@dataclass(frozen=True)
class Outcome:
    """What a command said and how it ended."""

    code: int
    out: str
    err: str
    arguments: tuple[str, ...] = ()

    @property
    def json(self) -> Any:
        """Stdout as the one JSON document that it must be, as its published schema has it."""
        document = json.loads(self.out)
        check_output(self.arguments, document)
        return document


Slipstand = Callable[..., Outcome]


@pytest.fixture
def slipstand(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Slipstand:
    """Run `slipstand ARGUMENTS` and return how it ended."""

    # A process of its own may leave functions uncompiled; this one goes on with other tests.
    monkeypatch.setattr("app.cli.simulate._is_brief", lambda _options: False)

    def run(*arguments: object) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["slipstand", *map(str, arguments)])
        capsys.readouterr()
        code: object = 0
        try:
            main()
        except SystemExit as ending:
            code = ending.code or 0
        said = capsys.readouterr()
        return Outcome(int(str(code)), said.out, said.err, tuple(map(str, arguments)))

    return run
