"""Random numbers of addresses, for parts of other packages: of single ones and of whole arrays.

Kernels of ours and of others compile them to the same code that `base.seeds` has.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import overload
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import DataError
from terrain_forge.base import mix as mix_one
from terrain_forge.base import uniform as uniform_one


def mix(key: ArrayLike, word: ArrayLike) -> NDArray[np.uint64]:
    """Hash one more 64-bit word of an address into a key; chain it over the whole address.

    Args:
        key: Key of a stage, or what this function returned for the words before, of any shape.
        word: The word, a whole number, of a shape that NumPy broadcasts against the key's.
    """
    with np.errstate(over="ignore"):
        mixed: NDArray[np.uint64] = mix_one.py_func(_words(key), _words(word))
    return mixed


def uniform(hashed: ArrayLike) -> NDArray[np.float64]:
    """Numbers in the open interval (0, 1) from the upper 53 bits of hashes, of their shape."""
    numbers: NDArray[np.float64] = uniform_one.py_func(_words(hashed))
    return numbers.reshape(np.shape(hashed))[()]  # NumPy 1 makes a number of an array of one


def _words(given: ArrayLike) -> Any:
    """Whole numbers as 64 bits, negative ones in two's complement as in kernels."""
    try:
        words = np.asarray(given)
    except ValueError:
        raise DataError("an address is made of whole numbers, in rows of one length") from None
    if words.dtype.kind not in "iu":
        raise DataError(f"an address is made of whole numbers, found {words.dtype}")
    return words.astype(np.uint64)[()]


overload(mix)(lambda key, word: mix_one.py_func)  # noqa: ARG005
overload(uniform)(lambda hashed: uniform_one.py_func)  # noqa: ARG005
