"""A binary heap of numbered items, the least key first, for kernels."""

from __future__ import annotations

from terrain_forge.base.kernels import inner


@inner
def heap_push(keys, items, size, key, item):  # type: ignore[no-untyped-def]
    """Put an item into a heap of `size`, which `keys` and `items` hold; returns its new size."""
    at = size
    while at > 0:
        above = (at - 1) // 2
        if keys[above] <= key:
            break
        keys[at], items[at] = keys[above], items[above]
        at = above
    keys[at], items[at] = key, item
    return size + 1


@inner
def heap_pop(keys, items, size):  # type: ignore[no-untyped-def]
    """Take the first item, `items[0]`, out of the heap; returns its new size."""
    size -= 1
    key, item = keys[size], items[size]
    at = 0
    while True:
        below = 2 * at + 1
        if below >= size:
            break
        if below + 1 < size and keys[below + 1] < keys[below]:
            below += 1
        if keys[below] >= key:
            break
        keys[at], items[at] = keys[below], items[below]
        at = below
    keys[at], items[at] = key, item
    return size
