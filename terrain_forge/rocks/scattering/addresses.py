"""The addresses by which all that chance gives a rock is hashed."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import kernel, mix, poisson, uniform

SIZE, EAST, NORTH, PROTOTYPE, YAW, BURIED, RETRY, KEEP = range(8)
"""What is drawn for a rock: the last word of its address."""


@kernel
def cell_counts(key, means):  # type: ignore[no-untyped-def]
    """Poisson number of rocks in each cell of a class, by their expected numbers, of one shape."""
    rows, columns = means.shape
    counts = np.empty((rows, columns), dtype=np.int64)
    for j in range(rows):
        for i in range(columns):
            counts[j, i] = poisson(mix(mix(mix(key, i), j), 0), means[j, i])
    return counts


@kernel
def addresses(key, column, row, counts):  # type: ignore[no-untyped-def]
    """Hashed addresses of the rocks of a region of cells that begins at (column, row)."""
    found = np.empty(counts.sum(), dtype=np.uint64)
    n = 0
    for j in range(counts.shape[0]):
        for i in range(counts.shape[1]):
            cell = mix(mix(key, column + i), row + j)
            for k in range(counts[j, i]):
                found[n] = mix(cell, k + 1)
                n += 1
    return found


@kernel
def words(address, what):  # type: ignore[no-untyped-def]
    """Extend each address by what is drawn there."""
    found = np.empty(len(address), dtype=np.uint64)
    for n in range(len(address)):
        found[n] = mix(address[n], what)
    return found


@kernel
def draw(address, what):  # type: ignore[no-untyped-def]
    """A uniform number in (0, 1) for each address."""
    drawn = np.empty(len(address))
    for n in range(len(address)):
        drawn[n] = uniform(mix(address[n], what))
    return drawn
