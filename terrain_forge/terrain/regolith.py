"""What regolith looks like: colours of named soils.

They are as a well exposed camera shows the soils, assumptions and no measurements. Their order is
that of the albedos: bright dust of Mars about 0.25 to 0.3 and dark sand 0.1 to 0.15, lunar maria
about 0.07 and highlands 0.15.
"""

from __future__ import annotations

from dataclasses import dataclass

RGB = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Regolith:
    """The looks of one kind of loose ground."""

    body: str
    """Where it lies, `mars` or `moon`."""
    rgb: RGB
    """Colour of level ground, sRGB 0 to 1."""


REGOLITHS = {
    "mars_dust": Regolith(body="mars", rgb=(0.73, 0.51, 0.35)),
    "mars_plains": Regolith(body="mars", rgb=(0.65, 0.43, 0.29)),
    "mars_sand": Regolith(body="mars", rgb=(0.44, 0.34, 0.28)),
    "lunar_mare": Regolith(body="moon", rgb=(0.35, 0.34, 0.33)),
    "lunar_highlands": Regolith(body="moon", rgb=(0.50, 0.49, 0.47)),
}
"""The soils that a recipe can name."""
