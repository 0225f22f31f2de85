"""Compiled code on disk is not used once any of its sources has changed."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import analysis.compiled

CALLEE = "from analysis.compiled import compiled_part\n\n\n@compiled_part\ndef part():\n    return {value}\n"
CALLER = (
    "from analysis.compiled import compiled\nfrom analysis.callee import part\n\n\n"
    "@compiled\ndef whole():\n    return part()\n"
)
REPORT = "from analysis.caller import whole; print(whole(), len(whole.stats.cache_hits))"


def in_a_fresh_interpreter(directory: Path) -> tuple[str, ...]:
    environment = {**os.environ, "PYTHONPATH": str(directory), "NUMBA_CACHE_DIR": str(directory / "cache")}
    result = subprocess.run(
        [sys.executable, "-c", REPORT],
        cwd=directory,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return tuple(result.stdout.split())


def test_a_change_in_a_called_function_reaches_its_callers_in_other_files(tmp_path):
    package = tmp_path / "analysis"
    package.mkdir()
    (package / "__init__.py").touch()
    shutil.copy(analysis.compiled.__file__, package / "compiled.py")
    (package / "caller.py").write_text(CALLER)
    (package / "callee.py").write_text(CALLEE.format(value=1))
    assert in_a_fresh_interpreter(tmp_path) == ("1", "0")
    assert in_a_fresh_interpreter(tmp_path) == ("1", "1")
    (package / "callee.py").write_text(CALLEE.format(value=2))
    assert in_a_fresh_interpreter(tmp_path) == ("2", "0")
