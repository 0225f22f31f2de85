"""A window system with a window manager, the program on it, and the hands of an operator."""

import contextlib
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.waiting import PATIENCE_S

NEEDED = ("Xvfb", "openbox", "xdotool", "xclip")
SIZE = "1400x900x24"
Place = tuple[int, int, int, int]
Shown = dict[str, Any]
_PROGRAM = Path(__file__).with_name("observed_program.py")


def missing_programs() -> list[str]:
    """Programs of a window system that this computer lacks."""
    return [name for name in NEEDED if shutil.which(name) is None]


@contextlib.contextmanager
def window_system(home: Path) -> Iterator[dict[str, str]]:
    """Environment of programs on a display of its own with a window manager."""
    reading, writing = os.pipe()
    server = ["Xvfb", "-screen", "0", SIZE, "-nolisten", "tcp", "-displayfd", str(writing)]
    with running(server, pass_fds=(writing,)):
        os.close(writing)
        with os.fdopen(reading) as numbers:
            number = numbers.readline().strip()
        environment = {
            **os.environ,
            "DISPLAY": f":{number}",
            "HOME": str(home),
            "QT_QPA_PLATFORM": "xcb",
            "SLIPSTAND_LANGUAGE": "en",
            "SLIPSTAND_RECORDINGS": str(home / "runs"),
            "SLIPSTAND_CONFIG": str(home / "config"),
            "SLIPSTAND_LOGS": str(home / "logs"),
            **{f"XDG_{kind}_HOME": str(home / kind) for kind in ("CONFIG", "DATA", "CACHE")},
        }
        environment.pop("WAYLAND_DISPLAY", None)
        with running(["openbox", "--sm-disable"], env=environment):
            yield environment


@contextlib.contextmanager
def running(command: list[str], **options: Any) -> Iterator[subprocess.Popen[str]]:
    """A process that is ended, with its children, at the end of the block."""
    process = subprocess.Popen(command, start_new_session=True, text=True, **options)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(10.0)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


@dataclass
class Desk:
    """The program on its display; what is done comes as events of the window system."""

    environment: dict[str, str]
    socket: Path
    process: subprocess.Popen[str]

    def look(self) -> list[Shown]:
        """All visible widgets; none while there is no window."""
        with socket.socket(socket.AF_UNIX) as line:
            line.settimeout(PATIENCE_S)
            try:
                line.connect(str(self.socket))
                parts = iter(lambda: line.recv(1 << 20), b"")
                return json.loads(b"".join(parts) or b"[]")
            except (FileNotFoundError, ConnectionError):
                return []

    def words(self) -> str:
        return "\n".join(one["text"] for one in self.look() if one["text"])

    def wait(self, seen: Callable[[], Any], what: str) -> Any:
        """Wait until something is seen, and return it."""
        deadline = time.perf_counter() + PATIENCE_S
        while not (found := seen()):
            if time.perf_counter() > deadline or self.process.poll() is not None:
                pytest.fail(f"{what} did not come; the window shows:\n{self.words()}")
            time.sleep(0.1)
        return found

    def wait_for(self, *words: str) -> None:
        self.wait(lambda: all(word in self.words() for word in words), repr(words))

    def wait_until_gone(self, words: str) -> None:
        self.wait(lambda: words not in self.words(), f"the end of {words!r}")

    def find(self, text: str, kind: str = "QWidget", *, enabled: bool = True) -> Shown:
        """The widget whose text or name begins so."""
        return self.wait(lambda: self._found(text, kind, enabled), f"{kind} {text!r}")

    def _found(self, text: str, kind: str, enabled: bool) -> Shown | None:
        likely = [one for one in self.look() if kind in one["kind"] and one["enabled"] >= enabled]
        exact = (one for one in likely if text in (one["name"], one["text"]))
        return next(exact, next((one for one in likely if one["text"].startswith(text)), None))

    def button(self, text: str) -> Shown:
        return self.find(text, "QAbstractButton")

    def focused(self) -> Shown | None:
        return next((one for one in self.look() if one["focused"]), None)

    def wait_for_field(self, window: str) -> None:
        """Wait until a field of an active window of this kind takes what is written."""

        def is_ready() -> bool:
            shown, focused = self.look(), self.focused()
            is_active = any(window in one["kind"] and one["is_active"] for one in shown)
            return is_active and focused is not None and "QLineEdit" in focused["kind"]

        self.wait(is_ready, f"a field of {window}")

    def plots(self) -> list[Shown]:
        """Plots of the largest stack that is shown."""
        stacks = [one for one in self.look() if one.get("plots")]
        return max(stacks, key=lambda one: one["place"][2] * one["place"][3])["plots"]

    def rows(self) -> list[Shown]:
        """Rows of the table that is shown."""
        return next((one["rows"] for one in self.look() if "rows" in one), [])

    # --- hands ---

    def press(self, *keys: str) -> None:
        self._act("key", "--clearmodifiers", *keys)

    def tab_to(self, text: str) -> None:
        """Go on by Tab until a button has the focus."""
        for _ in range(60):
            if (self.focused() or {"text": ""})["text"].startswith(text):
                return
            self.press("Tab")
        pytest.fail(f"Tab does not reach {text!r}")

    def write(self, text: str) -> None:
        self._act("type", "--delay", "8", text)

    def click(self, text: str, button: int = 1) -> None:
        """Click on a button by its text."""
        self.click_at(self.button(text)["place"], button)

    def click_at(self, place: Place, button: int = 1, times: int = 1, keys: str = "") -> None:
        x, y = middle_of(place)
        held = (("keydown", keys), ("keyup", keys)) if keys else ((), ())
        repeated = ("click", "--repeat", str(times), "--delay", "60", str(button))
        self._act("mousemove", str(x), str(y), "sleep", "0.05", *held[0], *repeated, *held[1])

    def choose(self, entry: str) -> None:
        """Click on an entry of the open menu."""

        def place() -> Place | None:
            menus = [one["parts"] for one in self.look() if "QMenu" in one["kind"]]
            return next((parts[entry] for parts in menus if entry in parts), None)

        self.click_at(self.wait(place, f"menu entry {entry!r}"))

    def drag(self, start: tuple[int, int], end: tuple[int, int], button: int = 1, keys: str = "") -> None:
        steps = []
        for part in (0.3, 0.6, 1.0):
            x, y = (round(a + part * (b - a)) for a, b in zip(start, end, strict=True))
            steps += ["mousemove", str(x), str(y), "sleep", "0.03"]
        held = (("keydown", keys), ("keyup", keys)) if keys else ((), ())
        first = ("mousemove", str(start[0]), str(start[1]), "sleep", "0.03")
        self._act(*first, *held[0], "mousedown", str(button), *steps, "mouseup", str(button), *held[1])

    def clipboard(self, target: str = "UTF8_STRING") -> bytes:
        """What a program that pastes receives."""
        command = ["xclip", "-selection", "clipboard", "-out", "-target", target]
        done = subprocess.run(
            command, env=self.environment, capture_output=True, timeout=PATIENCE_S, check=False
        )
        return done.stdout

    def title(self) -> str:
        """Title of the active window, as the window manager knows it."""
        return self._act("getactivewindow", "getwindowname").strip()

    def _act(self, *commands: str) -> str:
        done = subprocess.run(
            ["xdotool", *commands],
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            check=False,
        )
        return done.stdout


def middle_of(place: Place) -> tuple[int, int]:
    x, y, width, height = place
    return x + width // 2, y + height // 2


@contextlib.contextmanager
def program(environment: dict[str, str], home: Path, *arguments: str) -> Iterator[Desk]:
    """The program on a display, with nothing left of it afterwards."""
    path = home / "look"
    path.unlink(missing_ok=True)
    command = [sys.executable, str(_PROGRAM), str(path), *arguments]
    with running(command, env=environment) as process:
        desk = Desk(environment, path, process)
        desk.wait(lambda: any(one["is_active"] for one in desk.look()), "the window")
        yield desk
