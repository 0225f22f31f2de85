"""`slipstand device health` on a device of two counts."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from bench_kit import RATE_HZ, Bench
from cli_kit import assert_one_error_line

from tools import page_commands


@pytest.fixture
def bench() -> Iterator[Bench]:
    """Gauge 1 sends 7.0 for ever; gauge 2 is noisy."""
    bench = Bench([])
    yield bench
    bench.close()


def test_both_gauges_are_judged(slipstand: Any, bench: Bench, tmp_path: Path) -> None:
    device = ("--port", bench.port, "--protocol", "csv", "--set", "columns=table,relative", "--rate", RATE_HZ)
    figure = tmp_path / "health.svg"
    outcome = slipstand("device", "health", *device, "--seconds", 1.2, "--figure", figure, "--json")

    assert outcome.code == 1, outcome.err
    table, relative = outcome.json["gauges"]
    assert (table["verdict"], table["symptoms"][0]["code"]) == ("bad", "dead")
    assert relative["noise_rms_m"] == pytest.approx(0.5 * 4e-9, rel=0.15)  # half a count, 4 nm a count
    assert relative["samples"] >= 480
    assert figure.stat().st_size > 5000
    assert "Leave the stand alone" in outcome.err

    said = slipstand("device", "health", *device, "--seconds", 1.2)
    assert said.code == 1
    assert "gauge 1 (table): bad" in said.out
    assert "Touch the table" in said.out
    shown = page_commands.shown_lines("slipstand device health --port /dev/ttyACM0 --protocol csv")
    printed = re.sub("bad|doubtful", "good", said.out).splitlines()
    assert page_commands.faults(shown, printed, exactly=False) == [], "\n".join(printed)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--seconds", 0), "--seconds 0 must be"),
        (("--parity", "X"), "--parity 'X' is not known"),
        (("--figure", "a.bmp"), "--figure a.bmp has no known ending"),
        (("--figure", "/no/where/a.png"), "is not a folder"),
    ],
)
def test_what_cannot_be_is_refused(slipstand: Any, options: tuple[Any, ...], said: str) -> None:
    device = ("--port", "loop://", "--protocol", "csv")
    assert_one_error_line(slipstand("device", "health", *device, *options), said)
