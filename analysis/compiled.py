"""The two ways in which this package compiles: both without the interpreter lock, and kept on disk.

A compiled function holds copies of the functions that it calls, but numba keeps it on disk until its own
file changes. Here it is compiled again when any file of the package that holds compiled functions changes.
"""

import hashlib
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any, ParamSpec, TypeVar, cast

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


class _Interpretation:
    """Whether functions are left as they are written."""

    is_on = False


_interpretation = _Interpretation()


def interpret() -> None:
    """Leave the functions of modules that are imported from now on uncompiled; their results are the same.

    For a process that calls few of them, and briefly: to load numba and what is compiled takes half a second.
    """
    _interpretation.is_on = True


def compiled(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Compile a function that makes arrays, at its first call; later starts load it from the cache.

    Each new combination of argument types is compiled separately, so pass writable C-contiguous
    float64 arrays (numba takes a read-only array for another type). Division by zero gives inf or nan,
    as in numpy. Copy slices in loops: numba's slice assignment takes seconds to compile.
    """
    return _kept(function, {})


def compiled_part(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Compile likewise a function that makes no array.

    It goes without counting references to the arrays that it is given, which in small functions takes
    as long as the work: derivatives at 400 times take 29 us instead of 61.
    """
    return _kept(function, {"_nrt": False})


def compiled_sum(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Compile likewise a function of long sums, whose terms may be added in any order, several at once."""
    return _kept(function, {"_nrt": False, "fastmath": {"reassoc", "contract"}})


def compile_with(
    templates: Iterable[tuple[Callable[..., Any], Callable[..., Any]]], name: str, **replaced: object
) -> dict[str, Any]:
    """Compile functions of one module once more, with some of the names that they use replaced.

    numba neither keeps functions that take functions on disk nor inlines their arguments. So code that is
    common to several friction laws is written as templates, and each law has its own compiled copy.

    A template is a decorator of this module and an uncompiled function; each stands before its callers.
    `name` is an identifier that tells the copies apart on disk. `replaced` are compiled functions by the
    global name under which the templates call them. Returns all that the templates see, the copies included.
    """
    scope: dict[str, Any] = {}
    for decorate, template in templates:
        source = cast("FunctionType", template)
        scope = scope or {**source.__globals__, **replaced}
        function = FunctionType(source.__code__, scope, source.__name__, source.__defaults__)
        function.__qualname__ = f"{name}_{source.__name__}"
        scope[source.__name__] = decorate(function)
    return scope


def _kept(function: Callable[Parameters, Result], options: dict[str, Any]) -> Callable[Parameters, Result]:
    if _interpretation.is_on:
        return function
    from numba import njit  # takes as long to import as a whole small command

    dispatcher: Any = njit(nogil=True, error_model="numpy", **options)(function)
    dispatcher._cache = _cache_type()(function)
    return cast("Callable[Parameters, Result]", dispatcher)


@cache
def _cache_type() -> Any:
    """Cache of compiled functions on disk that follows `_sources`, and loads without what compiles.

    Numba loads its implementations of all types and operations before it looks into the cache, which takes
    0.15 s. It does so again before it compiles, so a function that is not in the cache loses nothing.
    """
    from numba.core.caching import FunctionCache
    from numba.core.runtime.nrt import rtsys

    class Cache(FunctionCache):
        def __init__(self, function: FunctionType) -> None:
            super().__init__(function)  # type: ignore[no-untyped-call]
            self._cache_file._source_stamp = (self._cache_file._source_stamp, _sources())

        def load_overload(self, signature: object, target: Any) -> Any:
            rtsys.initialize(target)  # counts references to arrays
            with self._guard_against_spurious_io_errors():
                return self._load_overload(signature, target)  # type: ignore[no-untyped-call]

    return Cache


@cache
def _sources() -> str:
    """Digest of the files of the package that hold compiled functions."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        text = path.read_bytes()
        if b"@compiled" in text:
            digest.update(text)
    return digest.hexdigest()
