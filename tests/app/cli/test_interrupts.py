"""Ctrl-C ends a command with 130 and one line, wherever it comes; the command sends it to itself."""

import subprocess
import sys
from pathlib import Path

import pytest

BEGIN = """
import signal, sys
sys.argv = ["slipstand", "simulate", "--series", "1FFM0"]
def interrupt(*_, **__):
    signal.raise_signal(signal.SIGINT)
"""
RUN = "\nfrom app.__main__ import main\nmain()\n"
SIMULATE = "import app.cli.simulate as command\n"
PLACES = {
    "while modules are loaded": """
class Finder:
    def find_spec(self, name, *_):
        if name == "app.cli.simulate":
            interrupt()
sys.meta_path.insert(0, Finder())
""",
    "in the command": SIMULATE + "command.simulate = interrupt",
    "in code that makes another error of it": SIMULATE
    + """
def simulate(_):
    try:
        interrupt()
    except KeyboardInterrupt:
        raise SystemError("returned a result with an exception set") from None
command.simulate = simulate
""",
    "in a callback of C": SIMULATE
    + """
import ctypes, time
def simulate(_):
    ctypes.CFUNCTYPE(None)(interrupt)()
    time.sleep(20.0 if sys.platform == "win32" else 3600.0)  # longer than a test may take
command.simulate = simulate
""",
    "in a command that Typer ends": SIMULATE
    + """
def simulate(_):
    raise KeyboardInterrupt
command.simulate = simulate
""",
}


def ended(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)


@pytest.mark.parametrize("place", PLACES)
def test_it_is_said_in_one_line(place: str) -> None:
    outcome = ended(BEGIN + PLACES[place] + RUN)
    assert (outcome.returncode, outcome.stderr) == (130, "interrupted\n")


def test_a_second_one_does_not_wait() -> None:
    patient = """
def simulate(_):
    try:
        interrupt()
    finally:
        interrupt()
        print("did not end")
command.simulate = simulate
"""
    outcome = ended(BEGIN + SIMULATE + patient + RUN)
    assert (outcome.returncode, outcome.stdout, outcome.stderr) == (130, "", "interrupted\n")


def test_a_command_that_is_done_is_left_alone() -> None:
    outcome = ended(BEGIN + "import atexit; atexit.register(interrupt)\n" + RUN)
    assert (outcome.returncode, outcome.stderr) == (0, "")
    assert outcome.stdout


@pytest.mark.skipif(sys.platform == "win32", reason="no signal can be held there")
def test_processes_that_are_starting_do_not_see_it(tmp_path: Path) -> None:
    code = """
import multiprocessing, signal, sys
from app.child_process import hold_interrupts
from app.runs.batch import executors
held = []
submit = executors.ProcessPoolExecutor.submit
def noted(*given):
    held.append(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, set()))
    answer = submit(*given)
    held.append(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, set()))
    return answer
executors.ProcessPoolExecutor.submit = noted
if __name__ == "__main__":
    executor = executors.ProcessExecutor(1)
    executor.submit(abs, -1).result()
    executor.close(now=True)
    print(held, signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, set()))
"""
    script = tmp_path / "held.py"
    script.write_text(code)
    outcome = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert outcome.stdout == "[True, True] False\n"
