"""Benchmarks and drills are run by hand: their imports must follow the modules that they measure."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
IMPORT_ALL = """
import ast, importlib, sys
for name in sys.argv[1:]:
    module = importlib.import_module(name)
    for text in vars(module).values():  # programs that a benchmark starts
        if isinstance(text, str) and text.startswith("\\nimport "):
            nodes = [node for node in ast.parse(text).body if isinstance(node, (ast.Import, ast.ImportFrom))]
            try:
                exec(compile(ast.Module(nodes, []), f"a program in {name}", "exec"), {})
            except ModuleNotFoundError as error:
                if error.name != "LDAQ":  # a peer in an environment of its own
                    raise
"""


@pytest.mark.skipif(sys.platform == "win32", reason="benchmarks ask POSIX for memory and time that was used")
def test_benchmarks_and_drills_find_what_they_import() -> None:
    benchmarks = sorted(path.stem for path in (ROOT / "benchmarks").glob("*.py"))
    drills = sorted(f"tests.drills.{path.stem}" for path in (ROOT / "tests" / "drills").glob("[a-z]*.py"))
    assert "decoders" in benchmarks
    assert "tests.drills.unplug" in drills
    places = os.pathsep.join(
        map(str, (ROOT, ROOT / "benchmarks", ROOT / "tests" / "analysis", ROOT / "tests"))
    )
    environment = os.environ | {"PYTHONPATH": places, "QT_QPA_PLATFORM": "offscreen"}
    command = [sys.executable, "-c", IMPORT_ALL, *benchmarks, *drills]
    ended = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
