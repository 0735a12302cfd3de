"""Mars.

Gravity and radius: NASA fact sheet (Williams). Irradiance: 1361 W/m² (Kopp & Lean 2011,
doi:10.1029/2010GL045777) over the square of the mean distance in astronomical units. Rocks are
taken as basalt; q(k) of Golombek et al. 2003, LPSC XXXIV. Density is an assumption within the usual
ranges (docs/science.md). Colours: dust has the chromaticity x = 0.42, y = 0.36, rock without it
0.32, 0.32, each to within 0.02 to 0.03 (InSight, Maki et al. 2021, doi:10.1029/2020EA001336); soils
are mixtures of both, a little towards the yellow of Curiosity's raw pictures (red over blue 1.7 to
1.8), with luminances of 0.18 (dust), 0.13 and 0.08 (sand); rocks show dust in part. Craters:
complex from about 6 km (Robbins & Hynek 2012, doi:10.1029/2011JE003967). Fresh ones of a kilometre
are 0.2 D deep, an average of what is reported for primaries. Laws of large craters are too deep for
small ones (Watters et al. 2015, JGR Planets 120, 226, from the abstract): 0.15 D at the small end
is an assumption, the middle between primaries (0.2) and secondaries (0.1), which counts do not tell
apart. No diffusivity was measured that would hold all over the planet: craters wear as equilibrium
needs.
Repose:
33°, an assumption within what dry sand and lee faces of dunes have (30° to 34°). Relief: Hellas to
Olympus Mons.
Orbit and rotation: at their values. Ellipsoid: IAU 2009, the same report.
"""

from __future__ import annotations

import math

from terrain_forge.model.body import (
    Body,
    Chronology,
    CraterConstants,
    Dust,
    Frictions,
    Photometry,
    ProductionFunction,
    Soil,
    sheared,
)
from terrain_forge.model.orbit import Ephemeris, KeplerOrbit, Rotation

_IVANOV = Chronology(burst=2.68e-14, steady=4.13e-4)

MARS = Body(
    name="mars",
    gravity=3.711,
    mean_radius=3389.5e3,
    solar_irradiance=586.2,
    sun_diameter=0.00611,
    airless=False,
    sky_rgb=(0.78, 0.50, 0.40),
    ground_rgb=(0.50, 0.37, 0.28),
    soils=(
        Soil(name="mars_dust", rgb=(0.59, 0.42, 0.31), pebbles=0.12, roughness=0.6),
        Soil(name="mars_plains", rgb=(0.50, 0.37, 0.28)),
        Soil(name="mars_sand", rgb=(0.36, 0.30, 0.25), pebbles=0.02, roughness=0.45),
    ),
    rock_rgb=(0.36, 0.31, 0.27),
    rock_density=2900.0,
    rock_decay=(1.79, 0.152),
    roughness=(0.58, 0.0959),
    friction=Frictions(
        regolith=sheared(
            30.0, 33.5, 37.0,
            "friction angles 30° to 37° of trenches by the Mars Exploration Rovers' wheels, "
            "Sullivan et al. 2011, doi:10.1029/2010JE003625",
        )
    ),
    repose=0.58,
    relief=(-9_000.0, 22_000.0),
    craters=CraterConstants(
        largest_simple=6_000.0,
        depth=(0.20, 0.0),
        shallow=(0.25, 250.0),
        equilibrium="hartmann",
        bright_ejecta=False,
        chronology=_IVANOV,
        productions=(
            ProductionFunction(
                kind="ivanov",
                coefficients=(
                    *(-3.383677, -3.197453, 1.256814, 0.7915374, -0.4860814, -0.3630098),
                    *(0.1015683, 0.06755923, -0.01180639, -0.004753462, 6.232845e-4, 5.805492e-5),
                ),
                range_km=(0.015, 362.0),
                chronology=_IVANOV,
                source="Ivanov 2001, doi:10.1023/A:1011941121102, numbers and ages",
            ),
            ProductionFunction(
                kind="hartmann_daubar",
                bins=(
                    *(1.10e5, 7.50e4, 4.50e4, 2.40e4, 1.10e4, 4.20e3, 1.60e3, 6.00e2, 1.90e2),
                    *(6.70e1, 2.40e1, 9.44, 3.30, 1.22, 4.37e-1, 1.47e-1, 4.70e-2, 1.38e-2),
                    *(4.02e-3, 1.15e-3, 3.08e-4, 1.28e-4, 6.85e-5, 3.67e-5, 1.98e-5, 1.06e-5),
                    *(5.68e-6, 3.04e-6, 1.62e-6, 8.71e-7, 4.67e-7, 2.40e-7, 1.12e-7, 5.21e-8),
                    *(2.43e-8, 1.13e-8, 5.28e-9, 2.47e-9, 1.15e-9, 5.37e-10),
                ),
                first_bin=-10.0,
                chronology=Chronology(burst=3.79e-14, steady=5.84e-4),
                source="Hartmann & Daubar 2016, Meteoritics & Planetary Science; new impacts of 1 "
                "to 30 m too, and secondaries; ages by Hartmann 2005 as in Michael 2013, "
                "doi:10.1016/j.icarus.2013.07.004",
            ),
        ),
    ),
    dust=Dust(
        tau=0.5,
        albedo=(0.95, 0.87, 0.75),
        share=(0.526, 0.575, 0.667),
        forward=(0.89, 0.90, 0.92),
        wide=(0.40, 0.33, 0.15),
        height=11_000.0,
        air_masses=22.0,
        source="albedos between those of Tomasko et al. 1999, doi:10.1029/1998JE900016, and "
        "Ockert-Bell et al. 1997, doi:10.1029/96JE03991; half of the extinction is diffraction by "
        "grains of 1.6 µm (van de Hulst 1957), the rest so that the mean cosine is 0.66 "
        "(Tomasko et al.); optical depth of a clear season (Lemmon et al. 2015, "
        "doi:10.1016/j.icarus.2014.03.029)",
    ),
    photometry=Photometry(
        albedo=0.85,
        lobe=0.12,
        back=0.2,
        surge=1.0,
        surge_width=0.05,
        roughness=math.radians(17.0),
        source="mean of the planet's surface in orbital images without the air: Vincendon 2013, "
        "arXiv:1208.4518 (c there is the part scattered back, 0.6)",
    ),
    ephemeris=Ephemeris(
        orbit=KeplerOrbit(
            semi_major=(1.52371034, 0.00001847),
            eccentricity=(0.09339410, 0.00007882),
            inclination=(1.84969142, -0.00813131),
            mean_longitude=(-4.55343205, 19140.30268499),
            perihelion=(-23.94362959, 0.44441088),
            node=(49.55953891, -0.29257343),
            source="1800 to 2050: Standish, Keplerian elements for approximate positions of the "
            "major planets (JPL), table 1",
        ),
        rotation=Rotation(
            right_ascension=(317.68143, -0.1061),
            declination=(52.88650, -0.0609),
            meridian=(176.630, 350.89198226, 0.0),
            source="IAU 2009, Archinal et al. 2011, doi:10.1007/s10569-010-9320-4",
        ),
        radii=(3396.19e3, 3376.20e3),
    ),
)  # fmt: skip
