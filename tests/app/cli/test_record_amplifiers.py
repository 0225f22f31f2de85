"""Every amplifier that the simulated stand can be, recorded into a run that finds the friction it has."""

import os
import shlex
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from raw_bytes_kit import load_raw_bytes

from app.runs.reader import load_counts, open_run
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from app.simulated_stand.truth import Truth
from config.files import settings_file
from drivers.devices.modbus.source import make_source
from drivers.driver import GAUGES
from drivers.registry import AVAILABLE, find_driver
from drivers.samples import SampleStatus
from drivers.simulated.faults import FrameFault
from drivers.stream import SampleSource

pytestmark = pytest.mark.skipif(os.name != "posix", reason="the simulated stand needs a pseudo-terminal")

OVERLOADS = SampleStatus.OVERLOAD_TABLE | SampleStatus.OVERLOAD_RELATIVE
QUICK = {"rest_s": 0.5, "pull_s": 0.5, "hold_s": 0.6, "decay_s": 5.0, "recentre_s": 0.3, "rate_hz": 1000.0}

PAIR_STARTS_S = 12.0
"""Until two devices begin their common motion: they are probed and connected before."""
LARGEST_SKEW_S = 2e-3

SIXTEEN_BITS = """
[table]
gain_m_per_count = 5.0e-7
zero_count = 40.0
range_m = 0.0163
[relative]
gain_m_per_count = -1.0e-6
zero_count = -30.0
range_m = 0.0325
"""
"""Gauges whose range a converter of 16 bits holds."""


@pytest.mark.parametrize(
    ("protocol", "settings"),
    [
        ("gsv", {}),
        ("gsv", {"format": "device", "table": "3", "relative": "1"}),
        ("harp", {"table": "5"}),
        ("csv", {"columns": "time_ms,sequence,relative,table,crc", "separator": "semicolon"}),
        ("csv", {"format": "dataq-ascii"}),
        (
            "csv",
            {"columns": "status,table,relative", "overload_status": "OL", "start": r"\x11", "line_end": "cr"},
        ),
    ],
    ids=["gsv", "gsv-int24", "harp", "csv", "dataq-ascii", "csv-status"],
)
def test_a_recorded_pullback_has_the_true_friction(
    slipstand: Any, tmp_path: Path, protocol: str, settings: dict[str, str]
) -> None:
    gauges = tmp_path / "gauges.toml"
    gauges.write_text(SIXTEEN_BITS if protocol == "harp" else settings_file("gauges.toml").read_text("utf-8"))
    options = SimulatedStandOptions(
        protocol=protocol, device=settings, gauges_file=str(gauges), seed=2, **QUICK
    )
    with SimulatedStand.start(options) as stand:
        place = [
            "--port",
            stand.port,
            "--protocol",
            protocol,
            "--directory",
            tmp_path,
            "--calibration",
            gauges,
        ]
        given = [part for key, value in settings.items() for part in ("--set", f"{key}={value}")]
        wanted = ["--series", "1FFM0", "--rate", 1000, "--pretrigger", 0.5, "--duration", 4.5, "--json"]
        recorded = slipstand("record", *place, *given, *wanted).json
        truth = stand.truth()
    true = truth.stand.friction_dynamic
    assert recorded["samples"] == 5000
    assert recorded["missing"] + recorded["damaged"] <= cut_in_the_port(truth)
    assert open_run(recorded["run"]).metadata.device.protocol == protocol
    (found,) = slipstand("analyze", recorded["run"], "--json").json
    assert found["results"]["friction_dynamic"]["value"] == pytest.approx(true, rel=0.01)


def cut_in_the_port(truth: Truth) -> int:
    """Samples that a port had no room for: a busy computer did not read for so long."""
    cut = {FrameFault.CUT, FrameFault.MERGED}  # a line behind one that was cut is part of it
    damage = [stretch for wire in (*truth.earlier, truth.wire) for stretch in wire.damage]
    return sum(stretch.samples for stretch in damage if stretch.fault in cut)


@pytest.mark.parametrize("protocol", [driver.name for driver in AVAILABLE])
def test_the_command_that_probe_prints_records_from_the_defaults_of_the_simulated_device(
    slipstand: Any, tmp_path: Path, protocol: str
) -> None:
    """No channel saturates or repeats its readings, and the friction is the true one."""
    pauses = {name: value for name, value in QUICK.items() if name != "rate_hz"}
    is_pair = find_driver(protocol).channels == 1
    given: dict[str, Any] = {"start_at_unix_s": time.time() + PAIR_STARTS_S} if is_pair else {}
    with ExitStack() as stack:
        stands = [
            stack.enter_context(
                SimulatedStand.start(
                    SimulatedStandOptions(protocol=protocol, gauge=gauge, seed=2, **given, **pauses)
                )
            )
            for gauge in (GAUGES if is_pair else (None,))
        ]
        (found,) = slipstand("device", "probe", stands[0].port, "--write", "--json").json
        command = shlex.split(found["speaks"]["command"].replace("PORT-OF-GAUGE-2", stands[-1].port))[1:]
        command += ["--calibration", stands[0].calibration] if stands[0].calibration else []
        command += ["--trigger-timeout", 60] if is_pair else []
        if protocol == "enod4":  # whose remark says that the rate must be given
            command += ["--rate", find_driver(protocol).simulated_rate_hz]
        wanted = ["--series", "1FFM0", "--pretrigger", 0.5, "--duration", 4.5, "--json"]
        recorded = slipstand(*command, "--directory", tmp_path, *wanted).json
        true = stands[0].truth().stand.friction_dynamic
    run = open_run(recorded["run"])
    skip_if_polls_were_late(recorded, protocol == "modbus")
    if (uncertainty_s := recorded.get("skew_standard_uncertainty_s") or 0.0) > LARGEST_SKEW_S:
        pytest.skip(f"this computer is too busy to time two streams: to {1e3 * uncertainty_s:.1f} ms")
    good = run.status == 0
    assert not (run.status & OVERLOADS).any()
    for readings in load_counts(run)[good].T:
        assert np.mean(readings == readings.max()) < 0.01
        assert np.mean(np.diff(readings) == 0) < 0.05
    (analysis,) = slipstand("analyze", recorded["run"], "--json").json
    found = analysis["results"]["friction_dynamic"]
    # Two streams that a busy computer could time only roughly have an uncertainty that says so.
    assert found["value"] == pytest.approx(true, abs=max(0.01 * true, found["expanded_uncertainty"])), found


def skip_if_polls_were_late(recorded: dict[str, Any], is_polled: bool) -> None:
    lost = (recorded["missing"] + recorded["damaged"]) / recorded["samples"]
    if is_polled and lost > 0.1:  # which the program takes for too busy
        pytest.skip(f"this computer is too busy for its polls: {lost:.0%} of them were late")


def test_a_polled_pullback_has_the_true_friction_and_says_that_it_is_quasi_static(
    slipstand: Any, tmp_path: Path
) -> None:
    settings = {"type": "float32", "order": "CDAB", "function": "4"}
    options = SimulatedStandOptions(protocol="modbus", device=settings, seed=2, **QUICK)
    with SimulatedStand.start(options) as stand:
        place = ["--port", stand.port, "--protocol", "modbus", "--directory", tmp_path, "--rate", 50]
        given = [part for key, value in settings.items() for part in ("--set", f"{key}={value}")]
        wanted = ["--series", "1FFM0", "--pretrigger", 0.5, "--duration", 4.5, "--json"]
        outcome = slipstand("record", *place, *given, *wanted)
        true = stand.truth().stand.friction_dynamic
    if outcome.code and "a poll takes" in outcome.err:
        pytest.skip(f"this computer is too busy to poll at 50 Hz: {outcome.err.splitlines()[-1]}")
    recorded = outcome.json
    assert (recorded["ended"], recorded["rate_hz"]) == ("duration", 50.0)
    assert "polled at 50 Hz, which is quasi-static" in recorded["message"]
    assert "quasi-static" in open_run(recorded["run"]).end.message
    assert_replays(recorded["run"], make_source(settings, 50.0))
    skip_if_polls_were_late(recorded, True)
    (found,) = slipstand("analyze", recorded["run"], "--json").json
    assert found["results"]["friction_dynamic"]["value"] == pytest.approx(true, rel=0.01)


def assert_replays(path: str, source: SampleSource) -> None:
    """The run's own bytes make its very samples again; rows before the first good one stand for no bytes."""
    run = open_run(path)
    recorded = np.column_stack([run.status, load_counts(run)])
    recorded = recorded[np.argmax(run.status == 0) :]
    blocks = [
        block
        for data, arrival_ns in load_raw_bytes(run).chunks()
        for block in source.decode(data, arrival_ns)
    ]
    made = np.concatenate([np.column_stack([block.status, block.counts]) for block in blocks])
    rows = len(recorded)
    assert rows > 200
    assert any(np.array_equal(made[k : k + rows], recorded) for k in range(len(made) - rows + 1))
