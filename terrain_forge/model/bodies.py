"""The planetary bodies, as cited values in SI units.

Sources: NASA Space Science Data Coordinated Archive fact sheets (Williams; gravity, radii); solar
irradiance is the solar constant 1361 W/m² (Kopp & Lean 2011, doi:10.1029/2010GL045777) divided by
the square of the mean distance in astronomical units. Densities and colours are assumptions within
the usual ranges (docs/science.md).
"""

from __future__ import annotations

from dataclasses import dataclass

from terrain_forge.base import Record


@dataclass(frozen=True, kw_only=True, eq=False)
class Body(Record):
    """A planet or moon as far as a rover's world needs it."""

    name: str
    """Lower-case name, as the recipe writes it."""
    gravity: float
    """Surface gravity [m/s²], towards -z."""
    mean_radius: float
    """Mean radius [m]."""
    solar_irradiance: float
    """Irradiance at the mean distance from the Sun, above any atmosphere [W/m²]."""
    sun_diameter: float
    """Apparent diameter of the Sun [rad]."""
    sky_rgb: tuple[float, float, float]
    """Colour of the sky, linear 0 to 1."""
    ground_rgb: tuple[float, float, float]
    """Colour of the regolith as a camera shows it, sRGB 0 to 1."""
    rock_rgb: tuple[float, float, float]
    """Colour of the rocks as a camera shows it, sRGB 0 to 1."""
    rock_density: float
    """Density of a rock [kg/m³]: basalt on Mars, breccia on the Moon."""
    roughness: tuple[float, float]
    """Fallback where no DTM tells: Hurst exponent, RMS deviation at 1 m [m]."""


MARS = Body(
    name="mars",
    gravity=3.711,
    mean_radius=3389.5e3,
    solar_irradiance=586.2,
    sun_diameter=0.00611,
    sky_rgb=(0.78, 0.50, 0.40),
    ground_rgb=(0.65, 0.43, 0.29),
    rock_rgb=(0.44, 0.33, 0.27),
    rock_density=2900.0,
    roughness=(0.58, 0.0959),
)

MOON = Body(
    name="moon",
    gravity=1.62,
    mean_radius=1737.4e3,
    solar_irradiance=1361.0,
    sun_diameter=0.00930,
    sky_rgb=(0.0, 0.0, 0.0),
    ground_rgb=(0.42, 0.41, 0.39),
    rock_rgb=(0.52, 0.51, 0.49),
    rock_density=2700.0,
    roughness=(0.76, 0.05),
)

BODIES = {body.name: body for body in (MARS, MOON)}
