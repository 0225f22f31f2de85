"""Child processes: messages in any cuts; hanging, dead and silent processes on either side."""

import contextlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from app.acquisition.messages import (
    Arm,
    Connect,
    Failed,
    Health,
    PortSettings,
    Quit,
    RunSettings,
    Stop,
    decode_command,
    decode_event,
)
from app.child import ONE_THREAD
from app.child_process import (
    ChildProcess,
    CommandReader,
    EventSender,
    LineDecoder,
    child_command,
    encode_line,
    json_decoder,
    spawn,
    watch_parent,
)
from messages.message import message
from tests.drills.processes import gone
from tests.waiting import PATIENCE_S, wait_until

COMMANDS = [
    Connect(PortSettings("/dev/x", "csv", device={"columns": "table,relative"}), "s", "g"),
    Arm(RunSettings("/runs", note="50 % moist; µ")),
    Stop(),
    Quit(),
]


class Pipe:
    """Both ends of a pipe, each closed once."""

    def __init__(self) -> None:
        self.read, self.write = os.pipe()
        self._open = {self.read, self.write}

    def close(self, *ends: int) -> None:
        for end in self._open & set(ends or self._open):
            self._open.remove(end)
            os.close(end)


@pytest.fixture
def pipe():
    pipe = Pipe()
    yield pipe
    pipe.close()


def command_reader(pipe: Pipe) -> CommandReader:
    return CommandReader(pipe.read, LineDecoder(decode_command).feed)


def event_sender(pipe: Pipe) -> EventSender:
    return EventSender(pipe.write, lambda event: isinstance(event, Health))


@pytest.mark.parametrize("size", [1, 7, 10_000])
def test_commands_come_whole_and_in_order_however_they_are_cut(pipe, size):
    reader = command_reader(pipe)
    line = b"".join(encode_line(command) for command in COMMANDS)
    for start in range(0, len(line), size):
        os.write(pipe.write, line[start : start + size])
    assert [reader.take(timeout_s=5.0) for _ in COMMANDS] == COMMANDS
    assert reader.take() is None
    assert not reader.is_closed
    pipe.close(pipe.write)
    assert reader.take(timeout_s=5.0) is None
    assert reader.is_closed


def test_what_is_no_command_closes_the_channel(pipe):
    reader = command_reader(pipe)
    os.write(pipe.write, encode_line(Stop()) + b"{not json\n")
    assert reader.take(timeout_s=5.0) == Stop()
    assert reader.take(timeout_s=5.0) is None
    assert reader.is_closed


def test_events_come_out_as_lines_and_failures_in_one(pipe):
    sender = event_sender(pipe)
    sender.send(Health(1000.0, 5, 0, 0, 0, 0, 10))
    sender.send(Failed(message("a fault\nin two lines")))
    sender.close()
    pipe.close(pipe.write)
    with os.fdopen(os.dup(pipe.read), "rb") as stream:
        events = [decode_event(line) for line in stream]
    assert events == [Health(1000.0, 5, 0, 0, 0, 0, 10), Failed(message("a fault\nin two lines"))]


@pytest.mark.skipif(not hasattr(os, "set_blocking"), reason="Windows has it from Python 3.12 on")
def test_an_owner_that_does_not_read_holds_nobody_up(pipe):
    sender = event_sender(pipe)
    for number in range(20_000):
        sender.send(Health(1000.0, number, 0, 0, 0, 0, 0))
    sender.send(Failed(message("the last word")))
    os.set_blocking(pipe.read, False)
    received = b""

    def has_failed() -> bool:
        nonlocal received
        with contextlib.suppress(BlockingIOError):
            received += os.read(pipe.read, 1 << 20)
        return b"the last word" in received

    wait_until(has_failed)
    sender.close()
    assert received.count(b"\n") < 20_000


def test_an_owner_that_is_gone_is_no_fault(pipe):
    sender = event_sender(pipe)
    pipe.close(pipe.read)
    sender.send(Failed(message("nobody hears")))
    sender.close()


# --- the parent's side ---

ECHO = """
from app.child_process import CommandReader, EventSender, LineDecoder, json_decoder, reserve_stdout
events, commands = EventSender(reserve_stdout()), CommandReader.of_stdin(LineDecoder(json_decoder(str)).feed)
print("this is no event")
while not commands.is_closed:
    if (command := commands.take(1.0)) is not None:
        events.send(command.upper())
events.close()
"""
LIBRARY_ASKS = ECHO.replace("print(", "import sys; events.send(sys.stdin.read() or 'its end'); print(")
DEAF = "import time; time.sleep(600)"


class Child:
    """A child that runs `code`, and what came from it."""

    def __init__(self, code: str, queue_size: int = 1024) -> None:
        self.events: list[str] = []
        self.codes: list[int] = []
        pipe = subprocess.PIPE
        self.process = subprocess.Popen([sys.executable, "-c", code], stdin=pipe, stdout=pipe)
        decode = json_decoder(str)
        self.child: ChildProcess[str, str] = ChildProcess(
            self.process, encode_line, decode, self.events.append, self.codes.append, queue_size
        )


def test_commands_and_events_arrive_in_order_and_stop_ends_the_child():
    echo = Child(ECHO)
    for word in ("one", "two", "a\udc80 file name that is no text"):
        assert echo.child.send(word)
    wait_until(lambda: len(echo.events) == 3)
    echo.child.stop(60.0)
    assert echo.events == ["ONE", "TWO", "A\udc80 FILE NAME THAT IS NO TEXT"]
    assert echo.codes == [0]
    assert echo.child.has_ended
    assert echo.child.send("nobody takes this")
    echo.child.stop(60.0)


def test_what_else_reads_stdin_finds_its_end_and_takes_no_command():
    child = Child(LIBRARY_ASKS)
    assert child.child.send("one")
    wait_until(lambda: len(child.events) == 2)
    child.child.stop(60.0)
    assert child.events == ["its end", "ONE"]


@pytest.mark.skipif(sys.platform != "linux", reason="looks at descriptors of another process")
@pytest.mark.parametrize(
    "module",
    [
        "app.acquisition.engine",
        "app.acquisition.live_client",
        "app.runs.exchange.reading_process",
        "app.runs.validator",
        "app.runs.writer",
        "app.simulated_stand.process",
    ],
)
def test_no_child_reads_the_stdin_that_libraries_see(module):
    with spawn(module, "{}", discard_stderr=True) as child:
        stdin = Path(f"/proc/{child.pid}/fd/0")
        wait_until(lambda: stdin.readlink() == Path(os.devnull))
        child.kill()


def test_queued_commands_are_executed_before_the_child_stops():
    echo = Child(ECHO)
    for number in range(500):
        assert echo.child.send(str(number))
    echo.child.stop(60.0)
    assert echo.events == [str(number) for number in range(500)]


def test_a_child_that_dies_in_the_middle_of_an_event_is_reported_with_its_code():
    child = Child('import os; os.write(1, b\'"whole"\\n"ha\'); os._exit(9)')
    wait_until(lambda: child.child.has_ended)
    assert (child.events, child.codes) == (["whole"], [9])
    child.child.stop(1.0)


def test_a_line_that_is_no_event_is_skipped():
    child = Child("print('not json'); print(); print('\"event\"')")
    wait_until(lambda: child.child.has_ended)
    assert child.events == ["event"]


def test_a_child_that_takes_nothing_does_not_block_its_parent_and_is_killed():
    deaf = Child(DEAF, queue_size=8)
    taken = sum(deaf.child.send("x" * 65536) for _ in range(100))
    assert taken < 100
    deaf.child.stop(0.1)
    assert deaf.process.returncode != 0
    assert deaf.codes == [deaf.process.returncode]


def test_stop_waits_for_a_child_that_still_sends_events():
    code = (
        "import time\nfor _ in range(15): print('\"busy\"', flush=True); time.sleep(0.1)\nraise SystemExit(4)"
    )
    busy = Child(code)
    wait_until(lambda: bool(busy.events))
    busy.child.stop(0.7, wait_while_active=True)
    assert busy.codes == [4]


def test_a_child_ends_when_its_parent_is_killed():
    code = (
        "import subprocess, sys, time\n"
        f"child = subprocess.Popen([sys.executable, '-c', {ECHO!r}], stdin=subprocess.PIPE)\n"
        "print(child.pid, flush=True); time.sleep(600)"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as parent:
        child_pid = int(parent.stdout.readline())
        parent.kill()
    assert gone(child_pid)


# --- how a child is started ---


def test_a_frozen_build_starts_its_children_by_its_own_name(monkeypatch):
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    monkeypatch.setattr(sys, "executable", "/opt/slipstand/slipstand")
    assert child_command("app.runs.writer", "x") == [
        "/opt/slipstand/slipstand",
        "--run-child",
        "app.runs.writer",
        "x",
    ]


def test_what_a_frozen_build_is_asked_for_runs_as_its_child(monkeypatch):
    """The executable of a frozen build does nothing but call `main` with its arguments."""
    program = "import sys; sys.frozen = True; from app.__main__ import main; main()"
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    _, *arguments = child_command("app.runs.validator")
    command = [sys.executable, "-c", program, *arguments]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as child:
        assert b"ValidatorReady" in child.stdout.readline()
        child.stdin.close()
        assert child.wait(PATIENCE_S) == 0


@pytest.mark.parametrize(("is_background", "flags"), [(False, 0x0800_0000), (True, 0x0800_4000)])
def test_windows_opens_no_console_for_a_child(monkeypatch, is_background, flags):
    given = {}
    monkeypatch.setattr(subprocess, "CREATE_NO_WINDOW", 0x0800_0000, raising=False)
    monkeypatch.setattr(subprocess, "BELOW_NORMAL_PRIORITY_CLASS", 0x4000, raising=False)
    monkeypatch.setattr(subprocess, "Popen", lambda _, **options: given.update(options))
    spawn("app.runs.writer", is_background=is_background)
    assert given["creationflags"] == flags


def test_children_start_no_threads_for_linear_algebra(monkeypatch):
    given = {}
    monkeypatch.setattr(subprocess, "Popen", lambda _, **options: given.update(options))
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "8")
    spawn("app.runs.writer")
    assert given["env"] == os.environ | ONE_THREAD


def test_a_process_sees_that_its_parent_has_ended():
    watcher = (
        "import time\nfrom app.child_process import watch_parent\nhas_ended = watch_parent()\n"
        "print(has_ended(), flush=True)\nwhile not has_ended(): time.sleep(0.01)"
    )
    code = (
        "import subprocess, sys\n"
        f"child = subprocess.Popen([sys.executable, '-c', {watcher!r}], stdout=subprocess.PIPE)\n"
        "print(child.pid, child.stdout.readline().decode(), flush=True); sys.stdin.read()"
    )
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", code], stdin=pipe, stdout=pipe, text=True) as parent:
        child_pid, has_ended = parent.stdout.readline().split()
        assert has_ended == "False"
        parent.kill()
    assert gone(int(child_pid))
    assert not watch_parent()()


@pytest.mark.parametrize("variable", ["NUMBA_CACHE_DIR", "MPLCONFIGDIR"])
def test_a_frozen_build_keeps_caches_in_the_folder_of_the_user(variable):
    """In its own folder a user may not write, and a common one is left when the program is removed."""
    program = (
        "import os, sys; sys.frozen = True; sys.argv = ['slipstand', '--version']\n"
        "from app.__main__ import main\n"
        f"main(); print(os.environ[{variable!r}])"
    )
    variables = {name: value for name, value in os.environ.items() if name != variable}
    done = subprocess.run(
        [sys.executable, "-c", program], env=variables, capture_output=True, text=True, check=True
    )
    assert [part for part in Path(done.stdout.splitlines()[-1]).parts if part == "slipstand"]
