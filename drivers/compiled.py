"""Compilation of the inner loops of decoders."""

import sys
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba.core.caching import FunctionCache
from numba.core.types import Array
from numba.extending import typeof_impl
from numba.np.numpy_support import from_dtype, map_layout
from numpy.typing import NDArray

_Function = TypeVar("_Function", bound=Callable[..., object])


def compiled(function: _Function) -> _Function:
    """Compile a loop that Python calls: cached on disk, without the interpreter lock, division as in numpy.

    Reference counting inside compiled code is off (`_nrt`), because counting at each call of a small helper
    halves the speed of a decoder. So such a function must not make arrays; it fills those that it is given.
    """
    return _compile(function, inline=False)


def inlined(function: _Function) -> _Function:
    """Compile a part of such a loop, inlined where it is called."""
    return _compile(function, inline=True)


class _Cache(FunctionCache):
    """Compiled functions on disk, loaded without what numba needs to compile: 0.03 s instead of 0.17 s.

    Numba loads its implementations of all types and operations before it looks into the cache. It does so
    again before it compiles, so a function that is not in the cache loses nothing.
    """

    def load_overload(self, signature: object, target: Any) -> Any:
        with self._guard_against_spurious_io_errors():
            return self._load_overload(signature, target)  # type: ignore[no-untyped-call]


def _compile(function: _Function, inline: bool) -> _Function:
    dispatcher = numba.njit(  # type: ignore[call-overload]  # its stubs leave `_nrt` out
        nogil=True, error_model="numpy", forceinline=inline, _nrt=False
    )(function)
    dispatcher._cache = _Cache(function)  # type: ignore[no-untyped-call]
    return cast(_Function, dispatcher)


_numba_array_type = typeof_impl.dispatch(np.ndarray)


@typeof_impl.register(np.ndarray)
def _array_type(array: NDArray[Any], context: object) -> Any:
    """Type of an array. Numba's own function imports numpy.ma, 0.02 s, to refuse masked arrays."""
    if "numpy.ma" in sys.modules:
        return _numba_array_type(array, context)
    kind = from_dtype(array.dtype)
    return Array(kind, array.ndim, map_layout(array), readonly=not array.flags.writeable)
