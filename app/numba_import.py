"""Import of numba without scipy.linalg, which takes longer to import than numba itself."""

import sys
from importlib.abc import MetaPathFinder
from typing import Any

_ASKING, _ANSWER = "numba.np.arraymath", "_HAVE_BLAS"
"""The module of numba that tries to import scipy.linalg, and where it keeps whether it could."""


class _NoLinearAlgebra(MetaPathFinder):
    """Refuses that one attempt. Numba loads scipy.linalg later where it compiles a product of matrices."""

    def find_spec(self, name: str, *_: Any) -> None:
        if name == "scipy.linalg" and _ASKING in sys.modules and not hasattr(sys.modules[_ASKING], _ANSWER):
            raise ModuleNotFoundError(f"not imported for {_ASKING}", name=name)


def install() -> None:
    """Let numba be imported without scipy.linalg from now on."""
    sys.meta_path.insert(0, _NoLinearAlgebra())
