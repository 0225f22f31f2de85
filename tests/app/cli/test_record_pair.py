"""Two simulated devices of one gauge each, read as one."""

import contextlib
import os
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.acquisition.messages import PortSettings
from app.acquisition.stream.live_stream import open_stream
from app.runs.reader import open_run
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from config.files import load_gauges
from drivers.samples import ABSENT_BY_GAUGE, SampleStatus
from tests.waiting import PATIENCE_S

pytestmark = pytest.mark.skipif(os.name != "posix", reason="the simulated stand needs a pseudo-terminal")

QUICK = {"rest_s": 0.5, "pull_s": 0.5, "hold_s": 0.6, "decay_s": 5.0, "recentre_s": 0.3}
PATIENT = ["--trigger-timeout", 60, "--json"]
HELD = QUICK | {"hold_s": 2.0}  # long enough to be seen where a busy computer leaves polls out


@contextlib.contextmanager
def two_stands(**options: Any):
    """Devices of gauge 1 and gauge 2 that show one motion, with clocks of their own."""
    both = options | {"start_at_unix_s": time.time() + 4.0}
    table = SimulatedStandOptions(gauge="table", clock_ppm=60.0, seed=2, **both)
    relative = SimulatedStandOptions(gauge="relative", clock_ppm=-70.0, seed=3, **both)
    with SimulatedStand.start(table) as first, SimulatedStand.start(relative) as second:
        yield first, second


def skip_where_polls_were_late(recorded: dict[str, Any]) -> None:
    """Leave out what follows on a computer too busy for its polls, which the program has to say."""
    if recorded["rate_hz"] < 30.0:
        assert "quasi-static" in recorded["message"]
        pytest.skip(f"this computer is too busy to poll: {recorded['rate_hz']:g} Hz miss the release")
    left_out = recorded["missing"] + recorded["missing_estimated"] + recorded["damaged"]
    late = left_out / recorded["samples"]
    if late > 0.1:
        status = open_run(recorded["run"]).status
        of_one = max(np.mean((status & int(flag)) != 0) for flag in ABSENT_BY_GAUGE)
        assert of_one <= 0.1 or "too busy to poll" in recorded["message"], "the program looks at each alone"
        pytest.skip(f"this computer is too busy for its polls: {late:.0%} of them were late")


def test_two_modbus_devices_find_the_true_friction(slipstand: Any, tmp_path: Path) -> None:
    with two_stands(protocol="modbus", rate_hz=1000.0, **HELD) as (first, second):
        ports = ["--port", first.port, "--relative-port", second.port, "--protocol", "modbus"]
        wanted = ["--series", "1FFM0", "--rate", 50, "--pretrigger", 0.5, "--duration", 4.5, *PATIENT]
        outcome = slipstand("record", *ports, "--directory", tmp_path, *wanted)
        assert outcome.code == 0, outcome.err
        recorded = outcome.json
        true = first.truth().stand.friction_dynamic
    run = open_run(recorded["run"])
    assert run.metadata.port == f"{first.port} + {second.port}"
    assert recorded["samples"] == pytest.approx(250, abs=1)
    # both are asked at the same moments of the host's clock
    assert abs(recorded["skew_s"]) < recorded["skew_standard_uncertainty_s"] < 3e-3
    assert run.end.time_base.skew_s == recorded["skew_s"]
    assert "gauge 2 was read" in recorded["message"]
    skip_where_polls_were_late(recorded)
    (found,) = slipstand("analyze", recorded["run"], "--json").json
    friction = found["results"]["friction_dynamic"]
    assert friction["value"] == pytest.approx(true, rel=0.01)
    assert friction["interval_95"][0] < true < friction["interval_95"][1]


def test_two_transmitters_on_ethernet_find_the_true_friction(slipstand: Any, tmp_path: Path) -> None:
    device = {"map": "flintec-dad141"}
    with two_stands(protocol="modbus", device=device, tcp_port=0, rate_hz=1000.0, **HELD) as (first, second):
        ports = ["--port", first.port, "--relative-port", second.port, "--protocol", "modbus"]
        wanted = ["--series", "1FFM0", "--rate", 50, "--pretrigger", 0.5, "--duration", 4.5, *PATIENT]
        given = ["--set", "map=flintec-dad141", "--directory", tmp_path]
        recorded = slipstand("record", *ports, *given, *wanted).json
        true = first.truth().stand.friction_dynamic
    skip_where_polls_were_late(recorded)
    assert open_run(recorded["run"]).metadata.port == f"{first.port} + {second.port}"
    assert first.port.startswith("socket://127.0.0.1:")
    (found,) = slipstand("analyze", recorded["run"], "--json").json
    assert found["results"]["friction_dynamic"]["value"] == pytest.approx(true, rel=0.01)


def test_two_multimeters_find_the_true_friction(slipstand: Any, tmp_path: Path) -> None:
    """Lines that are asked for have the host's time, so those of two ports belong together."""
    with two_stands(protocol="csv", device={"format": "scpi-read"}, **HELD) as (first, second):
        ports = ["--port", first.port, "--relative-port", second.port, "--protocol", "csv"]
        wanted = ["--series", "1FFM0", "--pretrigger", 0.5, "--duration", 4.5, *PATIENT]
        given = ["--set", "format=scpi-read", "--directory", tmp_path]
        outcome = slipstand("record", *ports, *given, *wanted)
        recorded = outcome.json
        skip_where_polls_were_late(recorded)
        assert outcome.code == 0, outcome.err
        true = first.truth().stand.friction_dynamic
    assert "quasi-static" in recorded["message"]
    (found,) = slipstand("analyze", recorded["run"], "--json").json
    assert found["results"]["friction_dynamic"]["value"] == pytest.approx(true, rel=0.01)


def test_two_streams_without_time_find_the_true_friction(slipstand: Any, tmp_path: Path) -> None:
    """Others are read by a clock of the test in `tests/app/simulated_stand/test_stand_over_port.py`."""
    device = {"format": "loadstar-iload"}
    with two_stands(protocol="csv", device=device, rate_hz=500.0, **QUICK) as (first, second):
        ports = ["--port", first.port, "--relative-port", second.port, "--protocol", "csv", "--rate", 500]
        wanted = ["--series", "1FFM0", "--pretrigger", 0.5, "--duration", 4.5, *PATIENT]
        given = ["--set", "format=loadstar-iload", "--directory", tmp_path]
        recorded = slipstand("record", *ports, *given, *wanted).json
        true = first.truth().stand.friction_dynamic
    if (uncertainty_s := recorded["skew_standard_uncertainty_s"]) > 2e-3:
        pytest.skip(f"this computer is too busy to time two streams: to {1e3 * uncertainty_s:.1f} ms")
    (found,) = slipstand("analyze", recorded["run"], "--json").json
    assert found["results"]["friction_dynamic"]["value"] == pytest.approx(true, rel=0.01)


def test_one_of_two_devices_is_unplugged_and_comes_back() -> None:
    with two_stands(protocol="csv", rate_hz=100.0) as (first, second):
        settings = PortSettings(first.port, "csv", relative_url=second.port)
        with open_stream(settings, load_gauges()) as stream:
            assert (stream.rate_hz, stream.port_identity) == (100.0, f"{first.port} + {second.port}")
            # beyond the stands' common beginning: what is disturbed before it does not end in time
            status = collected(stream, lambda status: np.count_nonzero(status == 0) > 450)
            second.disturb("unplug 1")
            status = collected(
                stream, lambda status: np.count_nonzero(status) > 60 and not status[-30:].any()
            )
            news = [news.message for news in stream.take_events()]
    gone = np.flatnonzero(status == SampleStatus.RELATIVE_MISSING)
    assert 60 < len(gone) < 1000
    assert not (status & SampleStatus.TABLE_MISSING).any()
    assert any("the device of gauge 2 is lost and is looked for" in str(one) for one in news)
    assert any("the device of gauge 2 was away and is back" in str(one) for one in news)
    assert not stream.is_disconnected


def collected(stream: Any, enough: Any) -> np.ndarray:
    """Flags of the rows until there are enough."""
    status = np.empty(0, np.uint8)
    end_s = time.perf_counter() + PATIENCE_S
    while not enough(status):
        assert time.perf_counter() < end_s, f"{len(status)} rows: {np.bincount(status)}"
        chunk = stream.next_read(0.1)
        status = np.concatenate([status, *([] if chunk is None else [rows.status for rows in chunk.rows])])
    return status
