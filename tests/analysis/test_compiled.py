"""Compiled code: not used from disk once any of its sources has changed, and loaded before it is needed."""

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
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(directory / "cache")}
    result = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(directory)!r}); {REPORT}"],
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


LOADED_BY_A_RECORD = """
import gc
from numba.core.dispatcher import Dispatcher
from analysis.identify import identify, warm_up
from analysis.laws.stribeck import STRIBECK_TILT
from analysis.synthetic import Truth, simulate_record

def loaded():
    dispatchers = [each for each in gc.get_objects() if isinstance(each, Dispatcher)]
    return {each.py_func.__qualname__: len(each.overloads) for each in dispatchers}

warm_up()
truth = Truth(friction_static=0.13, tilt_rad=5e-4, rate_hz=500.0, duration_s=6.0)
motion = STRIBECK_TILT.solver.simulate(truth.parameters(), [0.01], 6.1)
before = loaded()
found = identify(simulate_record(truth, motion.sample_displacements))
print(found.model.name, [name for name, count in loaded().items() if count > before.get(name, 0)])
"""


def test_no_record_waits_for_code_that_only_some_records_need():
    """The first record with Stribeck friction once took 5 s, in which its code was compiled or loaded."""
    printed = subprocess.run(
        [sys.executable, "-c", LOADED_BY_A_RECORD], capture_output=True, text=True, check=True
    ).stdout
    assert printed.split(maxsplit=1) == ["stribeck+tilt", "[]\n"]
