"""Processes of the program start numba without what it only looks for, and that works afterwards."""

import subprocess
import sys
from pathlib import Path

_DECODING = """
import sys
from app.optional_imports import claim_process
claim_process()
import numpy as np
from drivers.clock import rate_from_steps
from drivers.crc_slice import crc16_slice
crc16_slice(np.zeros(4, np.uint8), 0, 4)
"""
_PROCESS = f"""
{_DECODING}
assert rate_from_steps(np.full(1000, 1e-3)) == 1000
unused = {{"scipy", "yaml", "typing_extensions", "numpy.ma", "importlib.metadata"}} & set(sys.modules)
assert "numba" in sys.modules and not unused, unused
import scipy.linalg
import typing_extensions
import yaml
from numba import njit
assert njit(lambda a: a @ a)(np.eye(2)).tolist() == scipy.linalg.expm(np.zeros((2, 2))).tolist()
"""


def test_numba_starts_without_what_it_looks_for_and_finds_scipy_when_a_product_needs_it() -> None:
    subprocess.run([sys.executable, "-c", _DECODING], check=True)  # what has to be compiled loads more
    done = subprocess.run([sys.executable, "-c", _PROCESS], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_settings_file_of_numba_in_the_current_folder_is_read(tmp_path: Path) -> None:
    (tmp_path / ".numba_config.yaml").write_text("parallel_diagnostics: 3\n")
    process = "import app, numba; print(numba.config.PARALLEL_DIAGNOSTICS)"
    done = subprocess.run(
        [sys.executable, "-c", process], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert (done.stdout.strip(), done.stderr) == ("3", "")


def test_what_other_packages_of_a_process_need_is_left_to_them() -> None:
    process = """
import sys
import slipstand
slipstand.Record, slipstand.read_run
import numba, numba.core.entrypoints, msgspec._utils, typing_extensions
import numpy as np
import drivers.compiled
assert numba.core.entrypoints.__file__ and msgspec._utils._get_type_hints is typing_extensions.get_type_hints
try:
    numba.njit(lambda a: a)(np.ma.array([1.0], mask=[True]))
except numba.TypingError as refused:
    assert "masked" in str(refused).lower(), refused
else:
    raise AssertionError("a mask was passed over")
"""
    done = subprocess.run([sys.executable, "-c", process], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
