"""`python -m tools.packages [KIND...]`: build into `dist` what is named, without a name all that can be."""

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

from tools.packages import linux, windows
from tools.packages.folder import BUILD, make_folder, make_wheel, size_mb

KINDS = ("wheel", "tarball", "deb", "windows")


def main() -> int:
    """Build the packages, and say of each its size and how long it took."""
    parser = argparse.ArgumentParser(prog="python -m tools.packages", description=__doc__)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"some of: {', '.join(KINDS)}")
    parser.add_argument("--keep", action="store_true", help="use the folder that an earlier call has made")
    arguments = parser.parse_args()
    kinds = arguments.kinds or _of_this_system()
    if unknown := set(kinds) - set(KINDS):
        parser.error(f"unknown: {', '.join(unknown)}")
    folder = BUILD / "slipstand"
    if {"tarball", "deb"} & set(kinds) and not (arguments.keep and folder.is_dir()):
        _report(make_folder)
    makers: dict[str, Callable[[], Path]] = {
        "wheel": make_wheel,
        "tarball": lambda: linux.make_archive(folder),
        "deb": lambda: linux.make_debian_package(folder),
        "windows": windows.make_windows_installer,
    }
    for kind in kinds:
        _report(makers[kind])
    return 0


def _of_this_system() -> list[str]:
    return {"linux": ["wheel", "tarball", "deb"], "win32": ["wheel", "windows"]}.get(sys.platform, ["wheel"])


def _report(make: Callable[[], Path]) -> None:
    began_s = time.perf_counter()
    made = make()
    took_s = time.perf_counter() - began_s
    sys.stdout.write(f"{made}: {size_mb(made):.1f} MB, made in {took_s:.0f} s\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
