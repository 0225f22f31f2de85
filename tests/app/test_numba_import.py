"""Processes of the program start numba without scipy.linalg, and both work afterwards."""

import subprocess
import sys

_PROCESS = """
import sys
import app
import numpy as np
from drivers.crc_slice import crc16_slice
crc16_slice(np.zeros(4, np.uint8), 0, 4)
assert "numba" in sys.modules and "scipy.linalg" not in sys.modules
import scipy.linalg
from numba import njit
assert njit(lambda a: a @ a)(np.eye(2)).tolist() == scipy.linalg.expm(np.zeros((2, 2))).tolist()
"""


def test_numba_starts_without_scipy_linalg_and_finds_it_when_a_product_needs_it() -> None:
    done = subprocess.run([sys.executable, "-c", _PROCESS], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
