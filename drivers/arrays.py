"""Types of arrays."""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Int32s: TypeAlias = NDArray[np.int32]
UInt8s: TypeAlias = NDArray[np.uint8]
Flags: TypeAlias = NDArray[np.bool_]
Counts: TypeAlias = Int32s | Floats
Records: TypeAlias = NDArray[np.void]
"""A structured array."""
Record: TypeAlias = Any  # one element of a structured array inside compiled code, its fields as attributes


def record_type(ints: str, floats: str) -> np.dtype[np.void]:
    """Type of records with these fields of 64 bits, whole numbers and others, named with blanks between."""
    names = [(name, np.int64) for name in ints.split()] + [(name, np.float64) for name in floats.split()]
    return np.dtype(names, align=True)
