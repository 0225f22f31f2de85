"""Modules that numba and msgspec only look for, which take as long to import as they do, are left out."""

import sys
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any

_OPTIONAL = {
    "scipy": ("numba", "__version__"),
    "scipy.linalg": ("numba.np.arraymath", "_HAVE_BLAS"),
    "typing_extensions": ("msgspec._utils", "get_type_hints"),
    "yaml": ("numba.core.config", "_HAVE_YAML"),
}
"""Modules that are tried, the module that tries it, and a name that is defined in that one afterwards."""
_EXTENSIONS = "numba.core.entrypoints"
_ONLY_OURS = {_EXTENSIONS, "typing_extensions"}
"""What other packages of a process need where ours is a library: their extensions of numba, their types."""
_NUMBA_SETTINGS = Path(".numba_config.yaml")  # numba reads it in the current folder, if it is there


class _OptionalImports:
    """Refuses those attempts. Numba loads scipy.linalg later where it compiles a product of matrices.

    A `MetaPathFinder` without that base class, as its loader is one without its own: their module takes
    0.01 s to import.
    """

    is_our_process = False

    def find_spec(self, name: str, *_: Any) -> ModuleSpec | None:
        if name in _ONLY_OURS and not self.is_our_process:
            return None
        if name == _EXTENSIONS:
            return ModuleSpec(name, _NoExtensions())  # type: ignore[arg-type]  # as above
        asking, answer = _OPTIONAL.get(name, ("", ""))
        if asking not in sys.modules or hasattr(sys.modules[asking], answer):
            return None
        if name == "yaml" and _NUMBA_SETTINGS.exists():
            return None
        raise ModuleNotFoundError(f"not imported for {asking}", name=name)


class _NoExtensions:
    """Numba without extensions: it looks for them in all installed packages, and we have none."""

    def create_module(self, _: ModuleSpec) -> None:
        """Leave it to Python."""

    def exec_module(self, module: ModuleType) -> None:
        vars(module)["init_all"] = lambda: None


_imports = _OptionalImports()


def install() -> None:
    """Let numba be imported without them from now on."""
    sys.meta_path.insert(0, _imports)


def claim_process() -> None:
    """Leave out too what only other packages would need: this process is one of the program."""
    _imports.is_our_process = True
