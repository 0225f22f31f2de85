"""The two ways in which this package compiles: both without the interpreter lock, and kept on disk."""

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

from numba import njit

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


def compiled(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Compile a function that makes arrays, at its first call; later starts load it from the cache.

    Each new combination of argument types is compiled anew, so hand over writable C-contiguous
    float64 arrays (numba takes a read-only array for another type). Division by zero gives inf or nan,
    as in numpy. Copy slices in loops: numba's slice assignment takes seconds to compile.
    """
    decorated = njit(nogil=True, cache=True, error_model="numpy")(function)
    return cast("Callable[Parameters, Result]", decorated)


def compiled_part(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Compile likewise a function that makes no array.

    It goes without counting references to the arrays that it is given, which in small functions takes
    as long as the work: derivatives at 400 times take 29 us instead of 61.
    """
    decorate = njit(  # type: ignore[call-overload]  # its stubs leave `_nrt` out
        nogil=True, cache=True, error_model="numpy", _nrt=False
    )
    return cast("Callable[Parameters, Result]", decorate(function))
