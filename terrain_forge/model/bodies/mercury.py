"""Mercury.

Gravity and irradiance: NASA fact sheet (Williams). Radius: Perry et al. 2015,
doi:10.1002/2015GL065101. The Sun's diameter is that at the mean distance, 0.3871 au. Roughness: the
median Hurst exponent of intercrater plains (Fa et al. 2016, doi:10.1002/2016GL068120, from the
abstract; smooth plains have 0.66) over hundreds of metres; the deviation at 1 m is assumed to be
the Moon's.

Nobody has landed. Friction, the density of rocks and all colours are assumptions, like the Moon's
and a little darker. No size-frequency law was fitted to its rocks.

Craters: complex from 10.3 km (Pike 1988, in Vilas et al., Mercury, p. 165, as commonly quoted; the
change of depth near 10 km is Malin & Dzurisin's 1978). Fresh ones are as deep as images of Mariner
10 showed (Barnouin et al. 2012, doi:10.1016/j.icarus.2012.02.029, from the abstract), for which 0.2
D is taken. That small ones are shallower, the equilibrium, the diffusivity at 1 km and the bright
young ejecta are assumed to be the Moon's.
Ellipsoid: IAU 2015, Archinal et al. 2018, doi:10.1007/s10569-017-9805-5.
"""

from __future__ import annotations

import math

from terrain_forge.model.body import (
    Body,
    Chronology,
    CraterConstants,
    Frictions,
    Photometry,
    ProductionFunction,
    Soil,
    sheared,
)
from terrain_forge.model.orbit import Ephemeris, KeplerOrbit, Rotation

_NEUKUM = Chronology(burst=6.247e-14, steady=9.620e-4)

MERCURY = Body(
    name="mercury",
    gravity=3.70,
    mean_radius=2439.4e3,
    solar_irradiance=9082.7,
    sun_diameter=0.02403,
    airless=True,
    sky_rgb=(0.0, 0.0, 0.0),
    ground_rgb=(0.36, 0.345, 0.32),
    soils=(
        Soil(name="mercury_plains", rgb=(0.39, 0.37, 0.34)),
        Soil(name="mercury_low_reflectance", rgb=(0.29, 0.28, 0.27)),
    ),
    rock_rgb=(0.385, 0.37, 0.345),
    rock_density=2900.0,
    rock_decay=None,
    roughness=(0.80, 0.05),
    friction=Frictions(
        regolith=sheared(
            24.0, 37.0, 47.0,
            "assumption: the Moon's regolith, Hovland & Mitchell 1973 (NTRS 19730039283)",
        )
    ),
    craters=CraterConstants(
        largest_simple=10_300.0,
        depth=(0.20, 0.0),
        shallow=(0.38, 250.0),
        diffusivity_1_km=5.5,
        equilibrium="trask",
        bright_ejecta=True,
        chronology=_NEUKUM,
        productions=(
            ProductionFunction(
                kind="neukum",
                coefficients=(
                    *(-3.016675, -3.627417, 0.6038601, 1.026714, -3.767761e-3, -0.4204364),
                    *(-3.2235e-2, 8.044575e-2, 3.170165e-3, -6.733922e-3, 1.334403e-4),
                    1.428627e-4,
                ),
                range_km=(0.01, 100.0),
                chronology=_NEUKUM,
                source="Neukum et al. 2001, Planet. Space Sci. 49, 1507, "
                "doi:10.1016/S0032-0633(01)00089-7, coefficients as in Craterstats",
            ),
        ),
    ),
    photometry=Photometry(
        albedo=0.22,
        lobe=0.18,
        back=1.1,
        surge=2.7,
        surge_width=0.09,
        roughness=math.radians(20.0),
        source="650 nm: Warell & Valegård 2006, doi:10.1051/0004-6361:20065850, table 1",
    ),
    ephemeris=Ephemeris(
        orbit=KeplerOrbit(
            semi_major=(0.38709927, 0.00000037),
            eccentricity=(0.20563593, 0.00001906),
            inclination=(7.00497902, -0.00594749),
            mean_longitude=(252.25032350, 149472.67411175),
            perihelion=(77.45779628, 0.16047689),
            node=(48.33076593, -0.12534081),
            source="1800 to 2050: Standish, Keplerian elements for approximate positions of the "
            "major planets (JPL), table 1",
        ),
        rotation=Rotation(
            right_ascension=(281.0103, -0.0328),
            declination=(61.4155, -0.0049),
            meridian=(329.5988, 6.1385108, 0.0),
            waves=(
                (174.7910857, 4.092335, 0.0, 0.0, 0.01067257),
                (349.5821714, 8.184670, 0.0, 0.0, -0.00112309),
            ),
            source="IAU 2015, Archinal et al. 2018, doi:10.1007/s10569-017-9805-5",
        ),
        radii=(2440.53e3, 2438.26e3),
    ),
)  # fmt: skip
