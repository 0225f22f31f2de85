"""The library of `preload.c`, which disturbs the clock and the syncs of the programs that load it."""

import shutil
import subprocess
import sys
from pathlib import Path

CLOCK, SYNC = "DRILL_CLOCK", "DRILL_SYNC"
"""Variables that name the file of the clock's offset (s), and the one that hangs syncs of its folder."""


def has_compiler() -> bool:
    """Tell whether a library can be compiled and loaded before others here."""
    return sys.platform == "linux" and shutil.which("cc") is not None


def build_library(folder: Path) -> Path:
    """Compile the library into a folder. Raises subprocess.CalledProcessError."""
    library = folder / "preload.so"
    source = Path(__file__).with_name("preload.c")
    command = ["cc", "-shared", "-fPIC", "-O1", "-Wall", "-Werror", "-o", str(library), str(source)]
    subprocess.run(command, check=True, capture_output=True)
    return library
