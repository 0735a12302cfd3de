"""The Moon.

Gravity and radius: NASA fact sheet (Williams). Irradiance: Kopp & Lean 2011,
doi:10.1029/2010GL045777. Rocks are taken as breccia; q(k) is a fit to orbital and descent images
(Li & Wu 2018, doi:10.1029/2017JE005496), known at second hand. Density is an assumption within the
usual ranges (docs/science.md). Colours: maria reflect about 0.08 of the light, highlands 0.15, a
third more of red than of blue (laboratory spectra of Apollo's soils, as commonly quoted: an
assumption); rocks are an eighth brighter than their soil, which covers most of them.
Craters: complex where the depths of simple and complex ones cross (Pike 1977). Fresh ones are as
deep as Pike's, 0.196 D^1.010 km, and the shallower the smaller they are: the two figures are a fit,
within 0.005, to the classes of Stopar et al. 2017, doi:10.1016/j.icarus.2017.05.022 (0.13 from 40
to 100 m, 0.15 to 200 m, 0.17 to 400 m). Diffusivity at 1 km: Fassett & Thomson 2014,
doi:10.1002/2014JE004698, the mean of 3·10⁹ years.
Repose: 34°, an assumption. Relief: 11 km around the sphere.
Orbit and rotation: at their values.
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
from terrain_forge.model.orbit import EARTH_ORBIT, Ephemeris, Rotation, SatelliteOrbit

_NEUKUM = Chronology(burst=5.44e-14, steady=8.38e-4)

MOON = Body(
    name="moon",
    gravity=1.62,
    mean_radius=1737.4e3,
    solar_irradiance=1361.0,
    sun_diameter=0.00930,
    airless=True,
    sky_rgb=(0.0, 0.0, 0.0),
    ground_rgb=(0.39, 0.375, 0.35),
    soils=(
        Soil(name="lunar_mare", rgb=(0.325, 0.31, 0.285), rock_rgb=(0.345, 0.335, 0.31)),
        Soil(name="lunar_highlands", rgb=(0.44, 0.425, 0.395), rock_rgb=(0.465, 0.455, 0.43)),
    ),
    rock_rgb=(0.415, 0.40, 0.375),
    rock_density=2700.0,
    rock_decay=(0.5648, 0.01285),
    roughness=(0.76, 0.05),
    friction=Frictions(
        regolith=sheared(
            24.0, 37.0, 47.0,
            "friction angles 24° to 47°, mean 37°, of boulder tracks, Hovland & Mitchell 1973 "
            "(NTRS 19730039283)",
        )
    ),
    repose=0.59,
    relief=(-11_000.0, 11_000.0),
    craters=CraterConstants(
        largest_simple=10_583.0,
        depth=(0.196, 0.010),
        shallow=(0.38, 250.0),
        diffusivity_1_km=5.5,
        equilibrium="trask",
        bright_ejecta=True,
        chronology=_NEUKUM,
        productions=(
            ProductionFunction(
                kind="neukum",
                # a₀ as in Craterstats; -3.0876 as printed does not fit the function's own N(1 km).
                coefficients=(
                    *(-3.0768, -3.557528, 0.781027, 1.021521, -0.156012, -0.444058),
                    *(0.019977, 0.086850, -0.005874, -0.006809, 8.25e-4, 5.54e-5),
                ),
                range_km=(0.01, 100.0),
                chronology=_NEUKUM,
                source="Neukum et al. 2001, doi:10.1023/A:1011989004263",
            ),
        ),
    ),
    photometry=Photometry(
        albedo=0.222,
        lobe=0.254,
        back=0.160,
        surge=1.993,
        surge_width=0.0597,
        roughness=math.radians(23.657),
        source="643 nm at Tranquility Base in the maps of Sato et al. 2014, "
        "doi:10.1002/2013JE004580 (the cell's figures are known at second hand)",
    ),
    ephemeris=Ephemeris(
        orbit=EARTH_ORBIT,
        satellite=SatelliteOrbit(
            mean_longitude=(218.3164477, 481267.88123421, -0.0015786),
            arguments=(
                (297.8501921, 445267.1114034, -0.0018819),
                (357.5291092, 35999.0502909, -0.0001536),
                (134.9633964, 477198.8675055, 0.0087414),
                (93.2720950, 483202.0175233, -0.0036539),
            ),
            longitude=(
                (0, 0, 1, 0, 6.288774, -20905.355),
                (2, 0, -1, 0, 1.274027, -3699.111),
                (2, 0, 0, 0, 0.658314, -2955.968),
                (0, 0, 2, 0, 0.213618, -569.925),
                (0, 1, 0, 0, -0.185116, 48.888),
                (0, 0, 0, 2, -0.114332, -3.149),
                (2, 0, -2, 0, 0.058793, 246.158),
                (2, -1, -1, 0, 0.057066, -152.138),
                (2, 0, 1, 0, 0.053322, -170.733),
                (2, -1, 0, 0, 0.045758, -204.586),
                (0, 1, -1, 0, -0.040923, -129.62),
                (1, 0, 0, 0, -0.03472, 108.743),
                (0, 1, 1, 0, -0.030383, 104.755),
                (2, 0, 0, -2, 0.015327, 10.321),
                (0, 0, 1, 2, -0.012528, 0.0),
                (0, 0, 1, -2, 0.01098, 79.661),
                (4, 0, -1, 0, 0.010675, -34.782),
                (0, 0, 3, 0, 0.010034, -23.21),
                (4, 0, -2, 0, 0.008548, -21.636),
                (2, 1, -1, 0, -0.007888, 24.208),
                (2, 1, 0, 0, -0.006766, 30.824),
                (1, 0, -1, 0, -0.005163, -8.379),
                (1, 1, 0, 0, 0.004987, -16.675),
                (2, -1, 1, 0, 0.004036, -12.831),
                (2, 0, 2, 0, 0.003994, -10.445),
                (4, 0, 0, 0, 0.003861, -11.65),
                (2, 0, -3, 0, 0.003665, 14.403),
            ),
            latitude=(
                (0, 0, 0, 1, 5.128122),
                (0, 0, 1, 1, 0.280602),
                (0, 0, 1, -1, 0.277693),
                (2, 0, 0, -1, 0.173237),
                (2, 0, -1, 1, 0.055413),
                (2, 0, -1, -1, 0.046271),
                (2, 0, 0, 1, 0.032573),
                (0, 0, 2, 1, 0.017198),
                (2, 0, 1, -1, 0.009266),
                (0, 0, 2, -1, 0.008822),
                (2, -1, 0, -1, 0.008216),
                (2, 0, -2, -1, 0.004324),
                (2, 0, 1, 1, 0.0042),
                (2, 1, 0, -1, -0.003359),
                (2, -1, -1, 1, 0.002463),
                (2, -1, 0, 1, 0.002211),
                (2, -1, -1, -1, 0.002065),
            ),
            mean_distance=385000.56,
            mass_share=0.0121505843,
            source="the largest terms of Meeus 1998, Astronomical Algorithms, chapter 47, after "
            "ELP-2000/82 (Chapront-Touzé & Chapront 1983)",
        ),
        rotation=Rotation(
            right_ascension=(269.9949, 0.0031),
            declination=(66.5392, 0.0130),
            meridian=(38.3213, 13.17635815, -1.4e-12),
            waves=(
                (125.045, -0.0529921, -3.8787, 1.5419, 3.5610),
                (250.089, -0.1059842, -0.1204, 0.0239, 0.1208),
                (260.008, 13.0120009, 0.0700, -0.0278, -0.0642),
                (176.625, 13.3407154, -0.0172, 0.0068, 0.0158),
                (357.529, 0.9856003, 0.0, 0.0, 0.0252),
                (311.589, 26.4057084, 0.0072, -0.0029, -0.0066),
                (134.963, 13.0649930, 0.0, 0.0009, -0.0047),
                (276.617, 0.3287146, 0.0, 0.0, -0.0046),
                (34.226, 1.7484877, 0.0, 0.0, 0.0028),
                (15.134, -0.1589763, -0.0052, 0.0008, 0.0052),
                (119.743, 0.0036096, 0.0, 0.0, 0.0040),
                (239.961, 0.1643573, 0.0, 0.0, 0.0019),
                (25.053, 12.9590088, 0.0043, -0.0009, -0.0044),
            ),
            source="IAU 2009, Archinal et al. 2011, doi:10.1007/s10569-010-9320-4",
        ),
        radii=(1737.4e3, 1737.4e3),
    ),
)  # fmt: skip
