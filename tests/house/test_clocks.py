"""Time is measured by `time.perf_counter`: `time.monotonic` has steps of 15.6 ms on older Windows Pythons."""

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("analysis", "app", "config", "drivers", "messages", "slipstand", "tools")
COARSE = {"monotonic", "monotonic_ns"}


def test_no_module_of_the_program_reads_the_coarse_clock() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{line}"
        for package in PACKAGES
        for path in sorted((ROOT / package).rglob("*.py"))
        for line in lines_with_coarse_clock(path.read_text(encoding="utf-8"))
    ]
    assert not found


def test_every_way_to_name_it_counts() -> None:
    source = (
        "import time\nfrom time import sleep, monotonic\na = time.monotonic_ns()\nb = time.perf_counter()\n"
    )
    assert lines_with_coarse_clock(source) == [2, 3]


def lines_with_coarse_clock(source: str) -> list[int]:
    return sorted(
        node.lineno
        for node in ast.walk(ast.parse(source))
        if (isinstance(node, ast.Attribute) and node.attr in COARSE)
        or (isinstance(node, ast.ImportFrom) and COARSE & {name.name for name in node.names})
    )
