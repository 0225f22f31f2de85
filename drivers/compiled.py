"""Compilation of the inner loops of decoders."""

from collections.abc import Callable
from typing import TypeVar, cast

import numba

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


def _compile(function: _Function, inline: bool) -> _Function:
    decorate = numba.njit(  # type: ignore[call-overload]  # its stubs leave `_nrt` out
        nogil=True, cache=True, error_model="numpy", forceinline=inline, _nrt=False
    )
    return cast(_Function, decorate(function))
