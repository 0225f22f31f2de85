"""What is tried on Windows under Wine: demo, ports, kill and unplug while recording, window, tests."""

import contextlib
import json
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from tools.windows import suite
from tools.windows.environment import INSIDE, PROJECT, WindowsEnvironment

THEMES = ("light", "dark")
_RECORDINGS = f"{INSIDE}/recordings"
_RECORD_S = 600.0
_DEMO_S = 900.0  # the first one compiles
_COMPILE_S = 900.0
_TRUE_FRICTION = 0.1
_UNPLUGS = tuple(word for second in range(20, 600, 15) for word in ("--fault", f"unplug 2 at {second}"))
"""Of a simulated stand: whatever 25 s of it are recorded, its cable is pulled meanwhile."""
_WINDOW = r"""
mkdir -p /opt/windows/settings
printf 'theme = "{theme}"\n' > /opt/windows/settings/settings.toml
rm -f /tmp/.X{display}-lock /tmp/.X11-unix/X{display}  # of one that was killed
Xvfb :{display} -screen 0 1280x800x24 > /dev/null 2>&1 &
export DISPLAY=:{display} SLIPSTAND_CONFIG='Z:\opt\windows\settings'
export SLIPSTAND_RECORDINGS='Z:{recordings}/window-{theme}'
sleep 2; openbox > /dev/null 2>&1 &
wine /opt/windows/python/cp311/python.exe -m app --simulated > {recordings}/window-{theme}.log 2>&1 &
for second in $(seq 300); do  # the stand starts, then a test is armed by its key
  sleep 1; xdotool key a
  [ -n "$(find {recordings}/window-{theme} -name '*.h5.recording')" ] && break
done
sleep 4; import -window root {recordings}/window-{theme}-live.png
for second in $(seq 60); do
  sleep 1; [ -z "$(find {recordings}/window-{theme} -name '*.h5.recording')" ] && break
done
sleep 60; import -window root {recordings}/window-{theme}-result.png
cat {recordings}/window-{theme}.log
"""
_KILL = r"""
wine /opt/windows/python/cp311/python.exe -m app record {options} > {recordings}/kill.log 2>&1 &
for second in $(seq 120); do sleep 1; [ -n "$(find {recordings}/kill -name '*.h5.recording')" ] && break; done
sleep 2
kill -9 $(pgrep -o -x python.exe)  # the oldest is the command; its children are left
for second in $(seq 60); do sleep 1; pgrep -x python.exe > /dev/null || break; done
pgrep -x python.exe
"""


@dataclass(frozen=True)
class Check:
    """What one check gave."""

    name: str
    passed: bool
    figures: str


def demo(environment: WindowsEnvironment) -> Iterator[Check]:
    """Record the simulated stand over TCP and identify f_d."""
    began_s = time.perf_counter()
    ended = environment.run_python(
        "-m", "app", "demo", "--json", "--directory", f"Z:{_RECORDINGS}/demo", timeout_s=_DEMO_S
    )
    took_s = time.perf_counter() - began_s
    if ended.returncode:
        yield Check("demo", False, ended.stderr.strip()[-300:])
        return
    found = json.loads(ended.stdout)["results"]["friction_dynamic"]
    value, uncertainty = found["value"], found["standard_uncertainty"]
    figures = f"f_d {value:.5f} ± {uncertainty:.5f}, true {_TRUE_FRICTION}, in {took_s:.0f} s"
    yield Check("demo", abs(value - _TRUE_FRICTION) < 3.0 * uncertainty, figures)


def record_from_ports(environment: WindowsEnvironment) -> Iterator[Check]:
    """Record from a port, from one with a number above 9, and through an unplugged cable."""
    with _stand(environment, "--protocol", "csv"):
        for port in ("COM1", "COM12"):
            yield _record(environment, port, f"record from {port}", "--series", "1FFM0", "--duration", "3")
    with _stand(environment, "--protocol", "slipstand-binary", *_UNPLUGS):
        options = ("--protocol", "slipstand-binary", "--trigger", "none", "--duration", "25")
        yield _record(environment, "COM1", "unplug", *options, gap=True)


def kill(environment: WindowsEnvironment) -> Iterator[Check]:
    """Kill a command that records: a run of set duration is finished and stored, and no process stays."""
    folder = _empty_folder(environment, "kill")
    options = ["--port", "COM1", "--protocol", "csv", "--trigger", "none", "--duration", "20"]
    options += ["--directory", f"Z:{_RECORDINGS}/kill"]
    with _stand(environment, "--protocol", "csv"):
        script = _KILL.format(options=shlex.join(options), recordings=_RECORDINGS)
        ended = environment.run(["sh", "-c", script], _RECORD_S)
    left = ended.stdout.strip().splitlines()
    runs, locks = list(folder.glob("*.h5")), list(folder.glob("*.recording"))
    figures = f"{len(runs)} run stored, {len(left)} processes and {len(locks)} locks left"
    yield Check("kill", len(runs) == 1 and not left and not locks, figures)


def window(environment: WindowsEnvironment, display: int, pictures: Path) -> Iterator[Check]:
    """Record a test in the window, in each theme; pictures are taken while it slides and of the result."""
    folder = environment.root / _RECORDINGS.lstrip("/")
    pictures.mkdir(parents=True, exist_ok=True)
    for theme in THEMES:
        runs_folder = _empty_folder(environment, f"window-{theme}")
        script = _WINDOW.format(theme=theme, display=display, recordings=_RECORDINGS)
        ended = environment.run(["bash", "-c", script], _RECORD_S)
        taken = sorted(folder.glob(f"window-{theme}-*.png"))
        for picture in taken:
            (pictures / picture.name).write_bytes(picture.read_bytes())
        runs = list(runs_folder.glob("*.h5"))
        figures = f"{len(runs)} run recorded, pictures in {pictures} {ended.stdout.strip()[-300:]}"
        yield Check(f"window, {theme}", bool(runs) and len(taken) == 2, figures.strip())


def tests(
    environment: WindowsEnvironment, folder: Path, parts: Sequence[str], limit_s: float
) -> Iterator[Check]:
    """Run the tests part by part; their counts, and the table of all parts, are kept in a folder."""
    environment.run_python("-m", "tools.compile_all", timeout_s=_COMPILE_S)
    for part in parts:
        found = suite.run_part(environment, part, folder, limit_s)
        (folder / "tests.md").write_text(suite.table(folder), encoding="utf-8")
        counts = f"{found.passed} passed, {len(found.failed)} failed, {found.skipped} skipped"
        figures = f"{counts}, {found.not_run} not run in {found.took_s:.0f} s; {suite.log_path(folder, part)}"
        passed = found.passed > 0 and not found.failed and not found.not_run
        yield Check(part, passed, "\n      ".join([figures, *found.failed]))


def _record(environment: WindowsEnvironment, port: str, name: str, *options: str, gap: bool = False) -> Check:
    """Record a run and look at its counts; `gap`: the cable is pulled meanwhile."""
    protocol = () if "--protocol" in options else ("--protocol", "csv")
    folder = ("--directory", f"Z:{_RECORDINGS}/ports", "--json")
    ended = environment.run_python(
        "-m", "app", "record", "--port", port, *protocol, *options, *folder, timeout_s=_RECORD_S
    )
    if ended.returncode:
        return Check(name, False, ended.stderr.strip()[-300:])
    run = json.loads(ended.stdout)
    missing = run["missing"] + run["missing_estimated"]
    passed = run["ended"] == "duration" and bool(missing) == gap and not run["damaged"]
    return Check(name, passed, f"{run['samples']} samples, {missing} missing, ended: {run['ended']}")


def _empty_folder(environment: WindowsEnvironment, name: str) -> Path:
    """Make a folder of recordings without those of an earlier call."""
    folder = environment.root / _RECORDINGS.lstrip("/") / name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder


@contextlib.contextmanager
def _stand(environment: WindowsEnvironment, *options: str) -> Iterator[None]:
    """Run a simulated stand on Linux, whose terminal is the ports of Windows."""
    folder = environment.port.parent
    command = [sys.executable, "-m", "app", "device", "simulate", "--json", *options]
    with subprocess.Popen(
        ["env", f"TMPDIR={folder}", *command], cwd=PROJECT, stdout=subprocess.PIPE, text=True
    ) as stand:
        try:
            ready = json.loads(stand.stdout.readline() if stand.stdout else "")
            environment.port.unlink(missing_ok=True)
            environment.port.symlink_to(Path(ready["port"]).relative_to(folder))
            yield
        finally:
            stand.terminate()
