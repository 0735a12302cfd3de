"""All bodies that are installed: ours, and those of other packages."""

from __future__ import annotations

from terrain_forge.base import values
from terrain_forge.model.body import Body, unfit

BODIES = {
    body.name: body
    for body in values(Body, "terrain_forge.model.bodies", "terrain_forge.bodies", unfit=unfit)
}
"""The bodies by their names, in alphabetical order."""
