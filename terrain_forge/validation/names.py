"""What the names in an export tell: `rock_<id>…` is a rock's, `ground…` the ground's."""

from __future__ import annotations

import re

_ROCK = re.compile(r"(?:^|/)rock_(\d+)(?:$|_|/)")


def rock_of(*names: str) -> int | None:
    """The id of the rock that the first of the names tells, as `rock_<id>…`."""
    for name in names:
        found = _ROCK.search(name)
        if found:
            return int(found[1])
    return None


def is_ground(name: str) -> bool:
    """Whether a shape of that name is ground."""
    return name.lower().startswith("ground")
