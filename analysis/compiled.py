"""The one way in which this package compiles: without the interpreter lock, kept on disk."""

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

from numba import njit

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


def compiled(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Compile `function` at its first call; later starts load it from the cache.

    Each new combination of argument types is compiled anew, so hand over writable C-contiguous
    float64 arrays (numba takes a read-only array for another type). Division by zero gives inf or nan,
    as in numpy. Copy slices in loops: numba's slice assignment takes seconds to compile.
    """
    decorated = njit(nogil=True, cache=True, error_model="numpy")(function)
    return cast("Callable[Parameters, Result]", decorated)
