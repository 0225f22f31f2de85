"""`slipstand record` on the simulated stand, and everything that can be wrong with a port."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from cli_kit import assert_one_error_line

from app.runs.metadata import Conditions
from app.runs.reader import open_run
from app.simulated_stand.client import SimulatedStand
from app.simulated_stand.options import SimulatedStandOptions
from tests.waiting import PATIENCE_S

pytestmark = pytest.mark.skipif(os.name != "posix", reason="the simulated stand needs a pseudo-terminal")

QUICK = {"rest_s": 0.5, "pull_s": 0.5, "hold_s": 0.6, "decay_s": 5.0, "recentre_s": 0.3, "rate_hz": 1000.0}


@pytest.fixture
def stand(request: pytest.FixtureRequest) -> Iterator[SimulatedStand]:
    """A simulated stand with short pauses; parametrize to change its options."""
    with SimulatedStand.start(SimulatedStandOptions(**(QUICK | getattr(request, "param", {})))) as running:
        yield running


def recording(stand: SimulatedStand, folder: Path, protocol: str = "slipstand-binary") -> list[str]:
    """Arguments that record from `stand` into `folder`."""
    place = ["--port", stand.port, "--protocol", protocol, "--directory", str(folder)]
    return ["record", *place, "--series", "1FFM0", "--rate", "1000", "--pretrigger", "0.5"]


CONDITIONS = ["--temperature", "21.5", "--humidity", "48", "--plate-id", "P-1", "--contact-id", "C-7",
              "--surface", "acetone, 240 grit", "--run-in", "3", "--condition", "weather=dry"]  # fmt: skip


def test_two_runs_one_after_another(slipstand: Any, stand: SimulatedStand, tmp_path: Path) -> None:
    outcome = slipstand(*recording(stand, tmp_path), *CONDITIONS, "--duration", 3, "--count", 2, "--json")
    assert outcome.code == 0, outcome.err
    assert outcome.err.count("connected:") == 1
    assert [run["ended"] for run in outcome.json] == ["duration", "duration"]
    for document in outcome.json:
        assert {"run", "samples", "missing", "damaged", "overloaded", "rate_hz", "ended"} <= set(document)
        assert document["samples"] == len(open_run(document["run"])) == 3500
        assert document["rate_hz"] == pytest.approx(1000, rel=1e-3)
    conditions = [open_run(run["run"]).metadata.conditions for run in outcome.json]
    assert conditions[0] == Conditions(21.5, 48.0, "P-1", "C-7", "acetone, 240 grit", 3, {"weather": "dry"})
    assert conditions[1] == conditions[0].replace(run_in_number=4)
    _says_what_to_do(outcome.err)


def _says_what_to_do(told: str) -> None:
    steps = ["run 1 of 2", "Leave the stand alone", "Pull the table back to 12.0", "Hold the table still",
             "Let go", "Hands off", "Storing", "stored", "run 2 of 2", "Pull the table back"]  # fmt: skip
    places = [told.find(step) for step in steps[:-1]]
    assert -1 not in places, told
    assert places == sorted(places)
    assert told.rfind(steps[-1]) > places[-1]


@pytest.mark.parametrize("stand", [{"drop": 0.01, "flip": 0.01, "seed": 3}], indirect=True)
def test_two_per_cent_of_frames_damaged(slipstand: Any, stand: SimulatedStand, tmp_path: Path) -> None:
    recorded = slipstand(*recording(stand, tmp_path), "--duration", 4.5, "--json").json
    assert recorded["damaged"] > 0
    (found,) = slipstand("analyze", recorded["run"], "--json").json
    assert (
        found["quality"]["damaged"] + found["quality"]["missing"] == recorded["damaged"] + recorded["missing"]
    )
    assert found["results"]["friction_dynamic"]["value"] == pytest.approx(0.1, rel=0.01)


@pytest.mark.parametrize("stand", [{"protocol": "csv"}], indirect=True)
def test_csv_lines(slipstand: Any, stand: SimulatedStand, tmp_path: Path) -> None:
    recorded = slipstand(*recording(stand, tmp_path, "csv"), "--duration", 4.5, "--json").json
    assert recorded["samples"] == 5000
    (found,) = slipstand("analyze", recorded["run"], "--json").json
    assert found["results"]["friction_dynamic"]["value"] == pytest.approx(0.1, rel=0.01)


def test_interrupted_is_kept(stand: SimulatedStand, tmp_path: Path) -> None:
    command = [
        sys.executable,
        "-m",
        "app",
        *recording(stand, tmp_path),
        "--trigger",
        "none",
        "--duration",
        "60",
    ]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True)
    assert process.stderr is not None
    told = []
    while not told or "Recording" not in told[-1]:
        told.append(process.stderr.readline())
        assert process.poll() is None
    assert not any("rest" in line for line in told), "nothing is asked of the operator"
    time.sleep(1.0)
    os.killpg(process.pid, signal.SIGINT)
    process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    (path,) = tmp_path.glob("*.h5")
    run = open_run(path)
    assert run.end is not None
    assert run.end.ended == "interrupted"
    assert len(run) > 200


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--port", "/dev/no-such-port", "--protocol", "csv"], "/dev/no-such-port"),
        (["--port", "loop://", "--protocol", "morse"], "'morse'"),
        (["--port", "loop://", "--protocol", "scale-line"], "'scale-line'"),
        (["--port", "loop://", "--protocol", "csv", "--set", "colour=red"], "colour"),
        (["--port", "loop://", "--protocol", "csv", "--set", "colour"], "KEY=VALUE"),
        (["--port", "loop://", "--protocol", "csv", "--set", "format=openscale"], "one gauge, and two are"),
        (["--port", "loop://", "--protocol", "csv", "--series", "7XXM0"], "7XXM0"),
        (["--port", "loop://", "--protocol", "csv", "--calibration", "nix.toml"], "nix.toml"),
        (["--port", "loop://", "--protocol", "csv", "--duration", "-1"], "--duration -1"),
        (["--port", "loop://", "--protocol", "csv", "--parity", "X"], "'X'"),
        (["--port", "loop://", "--protocol", "csv", "--stop-bits", "3"], "'3'"),
        (["--port", "loop://", "--protocol", "csv", "--trigger", "none"], "--duration"),
        (["--port", "loop://", "--protocol", "csv", "--duration", "1", "--until-rest"], "--until-rest"),
        (["--port", "/dev/none", "--protocol", "csv", "--baud", "0"], "--baud 0"),
        (["--port", "/dev/none", "--protocol", "csv", "--plate-mass", "-3"], "--plate-mass -3"),
        (["--port", "/dev/none", "--protocol", "csv", "--table-mass", "nan"], "--table-mass nan"),
        (["--port", "/dev/none", "--protocol", "csv", "--pretrigger", "61"], "pretrigger 61 s"),
        (["--port", "/dev/none", "--protocol", "csv", "--pretrigger", "nan"], "pretrigger nan s"),
        (["--port", "/dev/none", "--protocol", "csv", "--temperature", "294"], "temperature_c = 294"),
        (["--port", "/dev/none", "--protocol", "csv", "--run-in", "-1"], "run_in_number = -1"),
        (["--port", "/dev/none", "--protocol", "csv", "--condition", "dry"], "--condition 'dry'"),
    ],
)
def test_what_cannot_be_is_one_line(slipstand: Any, tmp_path: Path, arguments: list[str], said: str) -> None:
    assert_one_error_line(slipstand("record", *arguments, "--directory", tmp_path), said)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_is_said_before_any_port_is_opened(slipstand: Any, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    wanted = ["record", "--port", "/dev/none", "--protocol", "csv", "--directory", tmp_path / "file" / "runs"]
    assert_one_error_line(slipstand(*wanted), "is not a folder")


def test_a_device_with_a_wrong_parity_is_said_in_one_line(slipstand: Any, tmp_path: Path) -> None:
    line = b"%d,1200,-340\r\n"
    sent = b"".join(line % (2000 * k) for k in range(400))
    garbled = bytes(byte if byte.bit_count() % 2 else 0 for byte in sent)
    with socket.create_server(("127.0.0.1", 0)) as server:
        url = f"socket://127.0.0.1:{server.getsockname()[1]}"

        def serve() -> None:
            reader, _ = server.accept()
            with reader, contextlib.suppress(OSError):
                while True:
                    reader.sendall(garbled)
                    time.sleep(0.05)

        serving = threading.Thread(target=serve)
        serving.start()
        outcome = slipstand("record", "--port", url, "--protocol", "csv", "--directory", tmp_path)
        serving.join()
    assert_one_error_line(outcome, "text read with a wrong parity: try --parity N, E or O")


def test_stop_bits_of_the_command_reach_the_port(slipstand: Any, tmp_path: Path) -> None:
    import termios

    device_end, reader_end = os.openpty()
    try:
        where = ("--port", os.ttyname(reader_end), "--protocol", "csv", "--directory", tmp_path)
        assert slipstand("record", *where, "--stop-bits", 2).code == 1
        flags = termios.tcgetattr(device_end)[2]
    finally:
        os.close(device_end)
        os.close(reader_end)
    assert flags & termios.CSTOPB


def test_a_silent_port_is_said_within_seconds(slipstand: Any, tmp_path: Path) -> None:
    outcome = slipstand(
        "record", "--port", "loop://", "--protocol", "slipstand-binary", "--directory", tmp_path
    )
    assert_one_error_line(outcome, "no good data in 3 s")


@pytest.mark.parametrize("stand", [{"protocol": "csv"}], indirect=True)
def test_the_wrong_protocol_says_what_came_instead(
    slipstand: Any, stand: SimulatedStand, tmp_path: Path
) -> None:
    assert_one_error_line(slipstand(*recording(stand, tmp_path), "--duration", 1), "csv")


def test_a_busy_port_is_said(slipstand: Any, stand: SimulatedStand, tmp_path: Path) -> None:
    command = [
        sys.executable,
        "-m",
        "app",
        *recording(stand, tmp_path),
        "--trigger",
        "none",
        "--duration",
        "30",
    ]
    holder = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        assert holder.stderr is not None
        while "Recording" not in holder.stderr.readline():
            assert holder.poll() is None
        assert_one_error_line(slipstand(*recording(stand, tmp_path), "--duration", 1), stand.port)
    finally:
        holder.send_signal(signal.SIGINT)
        holder.communicate(timeout=PATIENCE_S)
