"""The packages as a new user has them: installed on a bare system, used to the first f_d, removed.

`python -m tools.packages.checks [KIND...]`, called by `make try-packages`; it needs root.
"""

import argparse
import json
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from app.version import __version__
from tools.packages import linux
from tools.packages.bare import SUITES, USER, BareDebian
from tools.packages.folder import BUILD, DIST
from tools.packages.windows import INSTALLER_NAME
from tools.windows.__main__ import default_folder
from tools.windows.checks import Check
from tools.windows.environment import INSIDE, EnvironmentMissingError, WindowsEnvironment

_TRUE_FRICTION = 0.1
_STARTS = 3
"""Starts that are timed, of which the fastest counts: other programs only make it slower."""
_DISPLAY = 78
_KEPT = f"/home/{USER}/Documents/Slipstand"
_OWN = (".cache", ".config", ".local/state")
"""Folders of a user that the program has one in, and that no package may remove from there."""
_SETUP = f"{INSIDE}/setup.exe"
_WINDOWS_FOLDER = "drive_c/Program Files/Slipstand"
_OF_NSIS = "~nsu"
"""Start of the name of its uninstaller's copy, which Windows removes when it is started next."""
_WINDOWS_S = 1200.0
_WINDOW_OF_WINDOWS = r"""
rm -f /tmp/.X{display}-lock /tmp/.X11-unix/X{display}
Xvfb :{display} -screen 0 1280x800x24 > /dev/null 2>&1 &
export DISPLAY=:{display}
sleep 2; openbox > /dev/null 2>&1 &
wine {program} --simulated > /tmp/window.log 2>&1 &
for second in $(seq 600); do
  sleep 1; xdotool key a
  [ -n "$(find "$WINEPREFIX"/drive_c/users/*/Documents -name '*.h5.recording')" ] && break
done
sleep 60; import -window root /tmp/installed-window.png
xdotool key alt+F4; for second in $(seq 30); do sleep 1; pgrep -f slipstand-window > /dev/null || break; done
cat /tmp/window.log
"""


_WHILE_IT_RUNS = r"""
wine {program} device simulate --tcp 0 --json > /tmp/simulated.log 2>&1 &
for second in $(seq 120); do sleep 1; grep -q port /tmp/simulated.log && break; done
wine {setup} /S; echo $?
wine {uninstaller} /S; sleep 15
"""
"""Ends with the program: all that is run inside ends with its shell."""
_REFUSED = 2
"""Exit code of an installer that found the program running."""


def main() -> int:
    """Try what is named; 1 if something fails, with a line for each check."""
    kinds = {"tarball": try_tarball, "deb": try_debian_package}
    windows = "windows"
    parser = argparse.ArgumentParser(prog="python -m tools.packages.checks", description=__doc__)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"some of: {', '.join((*kinds, windows))}")
    parser.add_argument("--suites", nargs="*", default=list(SUITES), help="names of Debian's releases")
    arguments = parser.parse_args()
    if unknown := set(arguments.kinds) - {*kinds, windows}:
        parser.error(f"unknown: {', '.join(unknown)}")
    passed = True
    try:
        for suite in arguments.suites:
            system = BareDebian(default_folder().absolute().parent / "bare", suite, DIST)
            for kind in [kind for kind in arguments.kinds or kinds if kind in kinds]:
                system.prepare()
                passed = _report(f"{suite}, {kind}", kinds[kind](system)) and passed
        if windows in arguments.kinds:
            environment = WindowsEnvironment(default_folder().absolute())
            environment.prepare()
            passed = _report(windows, try_installer(environment)) and passed
    except EnvironmentMissingError as error:
        sys.stderr.write(f"error: {error}\n")
        return 1
    return 0 if passed else 1


def _report(system: str, checks: Iterator[Check]) -> bool:
    """Print a line for each check; false if one failed."""
    passed = True
    for check in checks:
        passed = passed and check.passed
        sys.stdout.write(f"{'ok  ' if check.passed else 'FAIL'}  {system}, {check.name}: {check.figures}\n")
        sys.stdout.flush()
    return passed


def try_tarball(system: BareDebian) -> Iterator[Check]:
    """Unpack it in the home of a user who is not root, use it, and remove it as its text says."""
    yield _step(system, "unpack", f"tar xzf /dist/{linux.ARCHIVE_NAME}", USER)
    program = f"slipstand-{__version__}/slipstand"
    yield from _use(system, program)
    yield _step(system, "remove", f"rm -r slipstand-{__version__}", USER)
    yield _nothing_left(system)


def try_debian_package(system: BareDebian) -> Iterator[Check]:
    """Install it, use it with and without a display, install a later version over it, and remove it."""
    before = _installed(system)
    yield _step(
        system, "install", f"apt-get install -y -qq --no-install-recommends /dist/{linux.DEBIAN_NAME}"
    )
    yield from _use(system, "slipstand")
    yield _window(system)
    settings = f"/home/{USER}/.config/slipstand/settings.toml"
    yield _step(
        system, "settings", f"mkdir -p {Path(settings).parent}; echo 'theme = \"dark\"' > {settings}", USER
    )
    later = linux.make_debian_package(BUILD / "slipstand", f"{__version__}+later", "none")
    kept = f"grep -q dark {settings} && slipstand runs {_KEPT}/recordings --json"
    yield _step(system, "install a later version", f"apt-get install -y -qq /dist/{later.name}")
    yield _step(system, "settings and recordings are kept", kept, USER)
    later.unlink()
    yield _step(system, "remove", "apt-get purge -y -qq slipstand && apt-get autoremove -y -qq --purge")
    left = _installed(system) - before
    yield Check("packages left", not left, ", ".join(sorted(left)) or "none")
    yield _nothing_left(system)


def try_installer(environment: WindowsEnvironment) -> Iterator[Check]:
    """Install it silently under Wine, record the simulated stand twice, look at the window, and uninstall."""
    prefix = environment.inside / "prefix"
    folder, inside = prefix / _WINDOWS_FOLDER, f"{INSIDE}/prefix/{_WINDOWS_FOLDER}"
    before = len(list((prefix / "drive_c" / "users").rglob("*.h5")))
    temporary = prefix / "drive_c" / "users" / "root" / "AppData" / "Local" / "Temp"
    temporary_before = set(temporary.glob("*"))
    shutil.copy(DIST / INSTALLER_NAME, environment.inside / "setup.exe")
    yield _windows_step(environment, "install", ["wine", _SETUP, "/S"], _WINDOWS_S)
    for name in ("ucrtbase.dll", "ucrtw.dll", "icuuc.dll"):  # what Wine lacks, not Windows
        shutil.copy(environment.inside / "python" / "cp311" / name, folder)
    program = ["wine", f"{inside}/slipstand.exe"]
    for _ in range(2):
        yield _windows_step(environment, "--version", [*program, "--version"], 300.0)
    for name in ("first demo, which compiles", "second demo"):
        began_s = time.perf_counter()
        ended = environment.run([*program, "demo", "--json"], _WINDOWS_S)
        took_s = time.perf_counter() - began_s
        found = _friction(name, ended.stdout, took_s)
        yield found if ended.returncode == 0 else Check(name, False, ended.stderr.strip()[-300:])
    script = _WINDOW_OF_WINDOWS.format(
        display=_DISPLAY, program=shlex.quote(f"{inside}/slipstand-window.exe")
    )
    said = environment.run(["bash", "-c", script], _WINDOWS_S).stdout.strip()
    picture = environment.root / "tmp" / "installed-window.png"
    recorded = len(list((prefix / "drive_c" / "users").rglob("*.h5"))) - before - 2
    yield Check("window", picture.is_file() and recorded == 1, f"{picture} {recorded} run {said[-300:]}")
    yield _while_it_runs(environment, folder, inside)
    for name in ("ucrtbase.dll", "ucrtw.dll", "icuuc.dll"):
        (folder / name).unlink()
    yield _windows_step(
        environment, "uninstall", ["sh", "-c", f"wine '{inside}/uninstall.exe' /S; wineserver -w"], 300.0
    )
    named = (path for path in (prefix / "drive_c").rglob("*") if "slipstand" in path.name.lower())
    left = [path for path in named if not path.is_relative_to(temporary)]  # whose new contents count
    users = prefix / "drive_c" / "users" / "root"
    own = (users / "Documents" / "Slipstand", users / "AppData" / "Local" / "slipstand")  # runs and settings
    kept = [path for path in left if any(path.is_relative_to(folder) for folder in own)]
    new = {path for path in temporary.glob("*") if not path.name.startswith(_OF_NSIS)} - temporary_before
    strange = sorted(str(path.relative_to(prefix)) for path in {*left, *new} if path not in kept)
    runs = list((prefix / "drive_c" / "users").rglob("*.h5"))
    yield Check(
        "nothing is left but recordings", not strange, f"{len(runs)} runs kept; {strange or 'no trace'}"
    )


def _while_it_runs(environment: WindowsEnvironment, folder: Path, inside: str) -> Check:
    """Neither installer nor uninstaller touches a program that runs."""
    script = _WHILE_IT_RUNS.format(
        setup=_SETUP,
        program=shlex.quote(f"{inside}/slipstand.exe"),
        uninstaller=shlex.quote(f"{inside}/uninstall.exe"),
    )
    before = _files(folder)
    said = environment.run(["bash", "-c", script], _WINDOWS_S).stdout.split()
    kept = _files(folder) == before
    figures = f"installer's exit code {said}, {len(before)} files {'kept' if kept else 'changed'}"
    return Check("install and uninstall while it runs", said == [str(_REFUSED)] and kept, figures)


def _files(folder: Path) -> dict[Path, int]:
    """Files of a folder with their times, by which a file that was written again is noticed."""
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}


def _windows_step(environment: WindowsEnvironment, name: str, command: list[str], timeout_s: float) -> Check:
    began_s = time.perf_counter()
    ended = environment.run(command, timeout_s)
    took_s = time.perf_counter() - began_s
    figures = (
        f"{took_s:.1f} s {ended.stdout.strip()[-100:]}" if ended.returncode == 0 else ended.stderr[-300:]
    )
    return Check(name, ended.returncode == 0, figures.strip())


def _use(system: BareDebian, program: str) -> Iterator[Check]:
    """Time the start, record the simulated stand twice, and read the run."""
    times = []
    for _ in range(_STARTS):
        began_s = time.perf_counter()
        shown = system.run([program, "--version"], USER)
        times.append(time.perf_counter() - began_s)
    yield Check("--version", shown.stdout.startswith(f"slipstand {__version__} ("), f"{min(times):.2f} s")
    for name in ("first demo, which compiles", "second demo"):
        yield _demo(system, program, name)
    yield _step(system, "runs", f"{program} runs {_KEPT}/recordings", USER)
    yield _step(system, "doctor", f"{program} doctor", USER)


def _demo(system: BareDebian, program: str, name: str) -> Check:
    began_s = time.perf_counter()
    ended = system.run([program, "demo", "--json"], USER)
    took_s = time.perf_counter() - began_s
    if ended.returncode:
        return Check(name, False, ended.stderr.strip()[-300:])
    return _friction(name, ended.stdout, took_s)


def _friction(name: str, printed: str, took_s: float) -> Check:
    friction = json.loads(printed)["results"]["friction_dynamic"]
    value, uncertainty = friction["value"], friction["standard_uncertainty"]
    figures = f"f_d {value:.5f} ± {uncertainty:.5f}, true {_TRUE_FRICTION}, in {took_s:.0f} s"
    return Check(name, abs(value - _TRUE_FRICTION) < 3.0 * uncertainty, figures)


def _window(system: BareDebian) -> Check:
    """Open the window on the simulated stand, on a display of this system, and picture it."""
    picture = BUILD / f"window-{system.suite}.png"
    picture.parent.mkdir(parents=True, exist_ok=True)
    picture.unlink(missing_ok=True)
    place = f":{_DISPLAY}"
    with subprocess.Popen(
        ["Xvfb", place, "-screen", "0", "1280x800x24"], stderr=subprocess.DEVNULL
    ) as display:
        try:
            taking = f"sleep 20; DISPLAY={place} import -window root {shlex.quote(str(picture))}"
            with subprocess.Popen(["sh", "-c", taking]) as camera:
                shown = system.run(["timeout", "30", "slipstand", "--simulated"], USER, place)
                camera.wait()
        finally:
            display.terminate()
    is_open = shown.returncode in (124, 130) and picture.exists()  # closed by `timeout`
    return Check("window", is_open, f"{picture} {shown.stderr.strip()[-300:]}".strip())


def _step(system: BareDebian, name: str, command: str, user: str = "root") -> Check:
    began_s = time.perf_counter()
    ended = system.run(["sh", "-c", command], user)
    took_s = time.perf_counter() - began_s
    figures = f"{took_s:.1f} s" if ended.returncode == 0 else (ended.stderr or ended.stdout).strip()[-300:]
    return Check(name, ended.returncode == 0, figures)


def _installed(system: BareDebian) -> set[str]:
    return set(system.run(["dpkg-query", "-W", "-f", "${Package}\n"]).stdout.split())


def _nothing_left(system: BareDebian) -> Check:
    """Only recordings, and what is the user's own, which is removed by one command of the guide."""
    own = " ".join(f"{folder}/slipstand" for folder in _OWN)
    system.run(["sh", "-c", f"rm -rf {own}"], USER)
    temporary = [str(path) for path in (system.layer / "tmp").glob("*")]
    left = [path for path in system.traces() if path != _KEPT] + temporary
    runs = system.layer / _KEPT.lstrip("/") / "recordings"
    kept = len(list(runs.glob("*.h5")))
    return Check(
        "nothing is left but recordings", kept == 2 and not left, f"{kept} runs kept; {left or 'no trace'}"
    )


if __name__ == "__main__":
    sys.exit(main())
