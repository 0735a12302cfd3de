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
"""

from __future__ import annotations

from terrain_forge.model.body import (
    Body,
    Chronology,
    CraterConstants,
    Frictions,
    ProductionFunction,
    Soil,
    sheared,
)

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
)  # fmt: skip
