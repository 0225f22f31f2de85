"""What `record --count` makes of runs that ended well, badly, or not at all; without any device."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from app.acquisition.errors import EngineFailedError
from app.acquisition.messages import EndReason, RunEnded


def run(number: int, reason: EndReason = EndReason.ENOUGH, message: str = "") -> RunEnded:
    return RunEnded(f"/runs/{number}.h5", reason, 100, 0, 0, 0, 0, 1000.0, 1.0, message)


@pytest.fixture
def record(slipstand: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """Run `record` with an engine that plays these runs, and then fails or not."""

    def play(runs: list[RunEnded], failure: Exception | None = None, count: int = 3, *more: str) -> Any:
        def each(*_: object, **__: object) -> Iterator[RunEnded]:
            yield from runs
            if failure is not None:
                raise failure

        monkeypatch.setattr("app.cli.record.record_with_progress", each)
        place = ["--port", "/dev/none", "--protocol", "csv", "--directory", str(tmp_path)]
        return slipstand("record", *place, "--count", count, *more)

    return play


def test_all_done(record: Any) -> None:
    outcome = record([run(1), run(2), run(3)])
    assert outcome.code == 0
    assert outcome.out.splitlines()[-1] == "3 of 3 runs recorded"


def test_interrupted_between_runs_what_is_there_is_listed(record: Any) -> None:
    outcome = record(
        [run(1), run(2), RunEnded("", EndReason.INTERRUPTED, 0, 0, 0, 0, 0, 1000.0)], None, 5, "--json"
    )
    assert outcome.code == 130
    assert [one["run"] for one in outcome.json] == ["/runs/1.h5", "/runs/2.h5"]


def test_interrupted_while_the_last_one_was_stored(record: Any) -> None:
    outcome = record([run(1), run(2)], None, 5)
    assert outcome.code == 130
    assert "2 of 5 runs recorded" in outcome.out


def test_a_run_that_ended_badly_is_listed_and_said(record: Any) -> None:
    outcome = record(
        [run(1), run(2, EndReason.DEVICE_LOST, "the device is gone. Plug it in")], None, 5, "--json"
    )
    assert outcome.code == 1
    assert [one["ended"] for one in outcome.json] == ["enough", "device-lost"]
    assert "the device is gone. Plug it in (kept in /runs/2.h5)" in outcome.err


def test_a_run_that_had_no_place_is_not_listed_but_said(record: Any) -> None:
    refused = RunEnded("", EndReason.DISK_FULL, 0, 0, 0, 0, 0, 1000.0, message="the disk is full. Free some")
    outcome = record([run(1), refused], None, 5, "--json")
    assert outcome.code == 1
    assert [one["run"] for one in outcome.json] == ["/runs/1.h5"]
    assert outcome.err.strip().endswith("error: the disk is full. Free some")


def test_an_engine_that_fails_takes_nothing_away(record: Any) -> None:
    outcome = record([run(1)], EngineFailedError("the port is gone. Plug it in"), 5, "--json")
    assert outcome.code == 1
    assert [one["run"] for one in outcome.json] == ["/runs/1.h5"]
    assert "error: the port is gone" in outcome.err


def test_one_run_is_one_object(record: Any) -> None:
    document = record([run(1)], None, 1, "--json").json
    assert document["run"] == "/runs/1.h5"
    assert "remaining" not in document
