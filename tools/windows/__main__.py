"""`python -m tools.windows [STEP...]`: make the environment, and run what is named, all without a name.

The first time takes some five minutes; what is made is kept in the user's cache, in `--folder`, or where
SLIPSTAND_WINE says.
"""

import argparse
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import platformdirs

from tools.windows import checks, suite
from tools.windows.checks import Check
from tools.windows.environment import EnvironmentMissingError, WindowsEnvironment

FOLDER_VARIABLE = "SLIPSTAND_WINE"


def main() -> int:
    """Run the steps; 1 if one of them fails, with a line for each check."""
    steps: dict[str, Callable[[], Iterator[Check]]] = {
        "demo": lambda: checks.demo(environment),
        "port": lambda: checks.record_from_ports(environment),
        "kill": lambda: checks.kill(environment),
        "window": lambda: checks.window(environment, arguments.display, environment.folder / "results"),
        "tests": lambda: checks.tests(
            environment, environment.folder / "results", arguments.parts, arguments.seconds
        ),
    }
    parser = argparse.ArgumentParser(prog="python -m tools.windows", description=__doc__)
    parser.add_argument("steps", nargs="*", metavar="STEP", help=f"some of: {', '.join(steps)}")
    parser.add_argument("--folder", type=Path, default=default_folder(), help="where all is kept")
    parser.add_argument(
        "--parts", nargs="+", default=list(suite.PARTS), metavar="PART",
        help=f"of the tests: {', '.join(suite.PARTS)}; or files and folders",
    )  # fmt: skip
    parser.add_argument("--seconds", type=float, default=3600.0, help="that a part of the tests may take")
    parser.add_argument("--display", type=int, default=77, help="number of the display that is made")
    arguments = parser.parse_args()
    if unknown := set(arguments.steps) - set(steps):
        parser.error(f"unknown: {', '.join(unknown)}")
    environment = WindowsEnvironment(arguments.folder.absolute())
    try:
        environment.prepare()
    except EnvironmentMissingError as error:
        sys.stderr.write(f"error: {error}\n")
        return 1
    environment.copy_project()
    passed = True
    for step in arguments.steps or steps:
        for check in steps[step]():
            passed = passed and check.passed
            sys.stdout.write(f"{'ok  ' if check.passed else 'FAIL'}  {check.name}: {check.figures}\n")
            sys.stdout.flush()
    return 0 if passed else 1


def default_folder() -> Path:
    """Where the environment is kept unless it is said otherwise."""
    given = os.environ.get(FOLDER_VARIABLE)
    return Path(given) if given else platformdirs.user_cache_path("slipstand", appauthor=False) / "wine"


if __name__ == "__main__":
    sys.exit(main())
