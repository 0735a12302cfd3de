"""Whether a population's rocks can lie anywhere on the site."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import RecipeError, kernel
from terrain_forge.model import Site
from terrain_forge.rocks.populations import PopulationSpec
from terrain_forge.rocks.scattering.corridor import corridors, is_kept_free, search_radius
from terrain_forge.rocks.scattering.intensity import Intensity, make_intensity, weight


def require_place(
    populations: tuple[PopulationSpec, ...], site: Site, intensity: Intensity | None = None
) -> None:
    """Refuse populations whose rocks cannot lie anywhere on a site.

    Args:
        populations: The rocks.
        site: The site.
        intensity: Their weights with slopes, where the whole site's are known.

    Raises:
        RecipeError: if slope limit, image, craters, corridors and exclusion zones together leave
            nothing.
    """
    known = intensity or make_intensity(populations, site)._replace(
        steepest=np.full(len(populations), np.inf)
    )
    strips = corridors(site)
    for number, population in enumerate(populations):
        limited = known.thins(number) or len(strips.half_width) > 0
        if limited and not _has_place(known, number, strips, population.diameters[0]):
            reasons = {
                "its slope limit": np.isfinite(known.steepest[number]),
                "its density image": population.density_image is not None,
                "its craters": known.around[number],
                "corridors and circles": len(strips.half_width) > 0,
            }
            found = ", ".join(name for name, there in reasons.items() if there)
            raise RecipeError(
                f"no place is left for {population.name!r} on the site: {found}",
                key=("rocks", "populations", number),
            )


@kernel
def _has_place(intensity, population, strips, diameter):  # type: ignore[no-untyped-def]
    """Whether rocks of a diameter [m] can lie in the middle of any triangle of the surface."""
    west, south, east, north = intensity.bounds
    limit = search_radius(strips, 0.0)
    for j in range(round((north - south) / intensity.spacing)):
        for i in range(round((east - west) / intensity.spacing)):
            for part in range(2):
                x = west + (i + (2 - part) / 3) * intensity.spacing
                y = south + (j + (1 + part) / 3) * intensity.spacing
                if weight(intensity, population, x, y, diameter) > 0.0:
                    if not is_kept_free(strips, x, y, limit):
                        return True
    return False
