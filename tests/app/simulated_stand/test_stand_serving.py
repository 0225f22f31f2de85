"""Ports of the simulated stand, and its command line."""

import json
import subprocess
import sys
import time

import msgspec

import app.simulated_stand.process as stand_process
from app.simulated_stand.options import SimulatedStandOptions
from app.simulated_stand.truth import Truth


def announced(**options) -> str:
    said = []
    stand_process.serve(SimulatedStandOptions(**options), said.append, lambda: True)
    return said[0].port


def test_without_pseudo_terminals_it_listens_on_this_computer(monkeypatch):
    monkeypatch.setattr(stand_process, "has_pseudo_terminals", lambda: False)
    assert announced().startswith("socket://127.0.0.1:")


def test_it_listens_on_the_port_that_it_is_given():
    number = announced(tcp_port=0).rpartition(":")[2]
    assert announced(tcp_port=int(number)) == f"socket://127.0.0.1:{number}"


def test_the_command_line_takes_faults_as_options_and_as_lines(tmp_path):
    truth = tmp_path / "truth.json"
    command = [
        *(sys.executable, "-m", "app", "device", "simulate", "--tcp", "0", "--json", "--control"),
        *("--fault", "stall 1 at 5", "--fault", "jump -2 at 6", "--truth", str(truth)),
    ]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True) as process:
        assert json.loads(process.stdout.readline())["port"].startswith("socket://127.0.0.1:")
        process.stdin.write("explode\nunplug 0.5 at 9\n")
        process.stdin.flush()
        refusal = process.stderr.readline()
        deadline = time.monotonic() + 30.0
        while (
            not (truth.exists() and msgspec.json.decode(truth.read_bytes(), type=Truth).disturbances)
            and time.monotonic() < deadline
        ):
            time.sleep(0.02)
        process.terminate()
        process.communicate()
    assert refusal.startswith("error: 'explode' is no fault")
    told = msgspec.json.decode(truth.read_bytes(), type=Truth)
    assert [(one.kind, one.at_s) for one in told.disturbances] == [("unplug", 9.0)]  # before any session
    assert told.options.disturbances == ("stall 1 at 5", "jump -2 at 6")


def test_a_fault_that_is_none_is_refused():
    command = [sys.executable, "-m", "app", "device", "simulate", "--fault", "explode"]
    refused = subprocess.run(command, capture_output=True, text=True, check=False)
    assert refused.returncode == 1
    assert refused.stderr.startswith("error: 'explode' is no fault")
    assert refused.stderr.count("\n") == 1
