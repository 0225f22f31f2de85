"""The packages as a new user has them: installed on a bare system, used to the first f_d, removed.

`python -m tools.packages.checks [KIND...]`, called by `make try-packages`; it needs root.
"""

import argparse
import json
import shlex
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from app.version import __version__
from tools.packages import linux
from tools.packages.bare import SUITES, USER, BareDebian
from tools.packages.folder import BUILD, DIST
from tools.windows.__main__ import default_folder
from tools.windows.checks import Check
from tools.windows.environment import EnvironmentMissingError

_TRUE_FRICTION = 0.1
_STARTS = 3
"""Starts that are timed, of which the fastest counts: other programs only make it slower."""
_DISPLAY = 78
_KEPT = f"/home/{USER}/Documents/Slipstand"
_OWN = (".cache", ".config", ".local/state")
"""Folders of a user that the program has one in, and that no package may remove from there."""


def main() -> int:
    """Try what is named; 1 if something fails, with a line for each check."""
    kinds = {"tarball": try_tarball, "deb": try_debian_package}
    parser = argparse.ArgumentParser(prog="python -m tools.packages.checks", description=__doc__)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"some of: {', '.join(kinds)}")
    parser.add_argument("--suites", nargs="*", default=list(SUITES), help="names of Debian's releases")
    arguments = parser.parse_args()
    if unknown := set(arguments.kinds) - set(kinds):
        parser.error(f"unknown: {', '.join(unknown)}")
    passed = True
    for suite in arguments.suites:
        system = BareDebian(default_folder().absolute().parent / "bare", suite, DIST)
        for kind in arguments.kinds or kinds:
            try:
                system.prepare()
            except EnvironmentMissingError as error:
                sys.stderr.write(f"error: {error}\n")
                return 1
            for check in kinds[kind](system):
                passed = passed and check.passed
                sys.stdout.write(
                    f"{'ok  ' if check.passed else 'FAIL'}  {suite}, {check.name}: {check.figures}\n"
                )
                sys.stdout.flush()
    return 0 if passed else 1


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
    friction = json.loads(ended.stdout)["results"]["friction_dynamic"]
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
    left = [path for path in system.traces() if path != _KEPT]
    runs = system.layer / _KEPT.lstrip("/") / "recordings"
    kept = len(list(runs.glob("*.h5")))
    return Check(
        "nothing is left but recordings", kept == 2 and not left, f"{kept} runs kept; {left or 'no trace'}"
    )


if __name__ == "__main__":
    sys.exit(main())
