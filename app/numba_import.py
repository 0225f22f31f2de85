"""Import of numba without modules that it only looks for, one of which takes longer to import than numba."""

import sys
from pathlib import Path
from typing import Any

_OPTIONAL = {
    "scipy.linalg": ("numba.np.arraymath", "_HAVE_BLAS"),
    "yaml": ("numba.core.config", "_HAVE_YAML"),
}
"""Modules that numba tries to import, the module of numba that does, and where it keeps whether it could."""
_NUMBA_SETTINGS = Path(".numba_config.yaml")  # numba reads it in the current folder, if it is there


class _NotForNumba:
    """Refuses those attempts. Numba loads scipy.linalg later where it compiles a product of matrices.

    A `MetaPathFinder` without that base class, whose module takes 0.01 s to import.
    """

    def find_spec(self, name: str, *_: Any) -> None:
        asking, answer = _OPTIONAL.get(name, ("", ""))
        if asking not in sys.modules or hasattr(sys.modules[asking], answer):
            return
        if name == "scipy.linalg" or not _NUMBA_SETTINGS.exists():
            raise ModuleNotFoundError(f"not imported for {asking}", name=name)


def install() -> None:
    """Let numba be imported without them from now on."""
    sys.meta_path.insert(0, _NotForNumba())
