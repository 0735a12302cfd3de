"""What `terrain-forge check` says of the rover: what was read of it, and what cannot be right."""

from __future__ import annotations

from collections.abc import Iterator

from terrain_forge.model import Rover, Site
from terrain_forge.paths import highest_step
from terrain_forge.rovers import doubt_stance, doubt_unit, told_radii

_WARNING = f"  {'warning':<12}"


def rover_lines(site: Site, rover: Rover) -> Iterator[str]:
    """What a site's rover is, and warnings of what cannot be right or is too fast for it."""
    if not rover.wheels:
        yield f"  {'rover':<12} {rover.name}: {rover.mass:.3g} kg, no wheels"
        return
    held = f", held: {', '.join(rover.held)}" if rover.held else ""
    yield (
        f"  {'rover':<12} {rover.name}: {rover.mass:.3g} kg, {len(rover.wheels)} wheels of "
        f"{told_radii(rover)} m driven{held}, step limit {highest_step(rover):.2g} m"
    )
    for note in rover.notes[bool(rover.held) :]:  # the first names those that are held
        yield f"  {'note':<12} {note}"
    yield from (f"{_WARNING} {text}" for text in rover.unread)
    doubts = doubt_unit(rover), doubt_stance(rover)
    yield from (f"{_WARNING} {text}" for text in doubts if text)
    if rover.length > min(site.size) or rover.width > min(site.size):
        yield (
            f"{_WARNING} the rover is {rover.length:.3g} m long and {rover.width:.3g} m wide, the "
            f"site {site.size[0]:g} × {site.size[1]:g} m"
        )
    validate = site.recipe.validate
    if rover.steering and validate and (validate.drive or validate.drives):
        yield (
            f"{_WARNING} joints that steer are held at rest ({', '.join(rover.steering)}): the "
            "rover turns by skidding, or not at all"
        )
    for path in site.recipe.paths:
        if path.speed_m_s > rover.speed_limit:
            yield (
                f"{_WARNING} {path.name}: {path.speed_m_s:g} m/s, the rover {rover.name} drives "
                f"at {rover.speed_limit:g} m/s at most"
            )
