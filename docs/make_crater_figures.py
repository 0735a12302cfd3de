"""Draws docs/images/craters_*.png: worn profiles, numbers on the laws, grounds of three ages."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LightSource
from matplotlib.figure import Figure
from numpy.typing import NDArray

from terrain_forge.dtm import FlatDtm
from terrain_forge.making import plan
from terrain_forge.model import MOON, Site
from terrain_forge.recipe import Recipe, TerrainSpec
from terrain_forge.terrain import (
    LIMITS,
    BodyProduction,
    CraterLayer,
    Craters,
    fresh_shapes,
    make_craters,
    population_of,
    shape_ground,
)

IMAGES = Path(__file__).parent / "images"
AGES = (0.1, 1.0, 3.5)
SIZE = 400.0


def main() -> None:
    """Write the pictures."""
    _save(_profiles(), "profiles")
    _save(_numbers(), "numbers")
    _save(_grounds(), "grounds")


def _save(figure: Figure, name: str) -> None:
    FigureCanvasAgg(figure)
    figure.savefig(IMAGES / f"craters_{name}.png", metadata={"Software": None})


def _site(age: float, *, spacing: float) -> tuple[Site, CraterLayer]:
    layer = CraterLayer(
        production=BodyProduction(kind="neukum", age_ga=age), diameter_m=(2.0, 200.0)
    )
    recipe = Recipe(
        name="figure",
        seed=8,
        body="moon",
        dtm=FlatDtm(size_m=(SIZE, SIZE)),
        terrain=TerrainSpec(spacing_m=spacing, layers=(layer,)),
        exports=(),
    )
    return plan(recipe), layer


def _profiles() -> Figure:
    """Profiles of a crater of 100 m, fresh and worn."""
    figure = Figure(figsize=(9, 2.2), dpi=110, layout="constrained")
    axes = figure.subplots()
    distance = np.linspace(-160.0, 160.0, 1281)
    for wear, text in ((0.0, "fresh"), (0.001, "0.001"), (0.005, "0.005"), (0.02, "0.02")):
        height = _single(100.0, wear).profile(0, np.abs(distance))
        axes.plot(distance, height, label=text if wear == 0.0 else f"κt/D² = {text}")
    axes.set(xlabel="distance from the centre [m]", ylabel="height [m]", xlim=(-160, 160))
    axes.set_title("A crater of 100 m on the Moon, heights 3 times", fontsize=10)
    axes.set_aspect(3.0)
    axes.legend(fontsize=8, frameon=False)
    axes.grid(alpha=0.3)
    return figure


def _single(diameter: float, wear: float) -> Craters:
    diameters = np.array([diameter])
    shape = fresh_shapes(diameters, body=MOON)
    return Craters(
        id=np.zeros(1),
        listed=np.zeros(1),
        xy=np.zeros((1, 2)),
        diameter=diameters,
        age=np.zeros(1),
        fresh_depth=shape.depth,
        fresh_rim=shape.rim,
        fresh_ejecta=shape.ejecta,
        wear=np.array([wear]),
    )


def _numbers() -> Figure:
    """Realised numbers of three ages on the laws."""
    figure = Figure(figsize=(6, 4.4), dpi=110, layout="constrained")
    axes = figure.subplots()
    diameter = np.geomspace(2.0, 200.0, 300)
    for number, age in enumerate(AGES):
        site, layer = _site(age, spacing=0.5)
        population = population_of(layer, site=site)
        craters = make_craters(layer, site=site, area=site.bounds)
        inside = np.all(np.abs(craters.xy) <= 0.5 * SIZE, axis=1)
        found = np.sort(craters.diameter[inside])[::-1]
        axes.plot(diameter, 1e6 * population.number(diameter), color=f"C{number}", lw=1)
        axes.plot(
            found,
            np.arange(1, found.size + 1) * 1e6 / SIZE**2,
            ".",
            ms=2,
            color=f"C{number}",
            label=f"{age:g} Ga, {found.size} craters on {SIZE:g} m × {SIZE:g} m",
        )
    trask = 1e6 * LIMITS["trask"].number(diameter)
    axes.plot(diameter, trask, color="0.5", ls=":", label="equilibrium, Trask 1966")
    axes.set(xscale="log", yscale="log", xlabel="diameter [m]", ylabel="craters ≥ D on a km²")
    axes.set_ylim(1.0, 5e4)
    axes.legend(fontsize=8, frameon=False)
    axes.grid(alpha=0.3)
    return figure


def _grounds() -> Figure:
    """Hillshades of three ages."""
    figure = Figure(figsize=(9, 3.3), dpi=110, layout="constrained")
    for axes, age in zip(figure.subplots(1, len(AGES)), AGES, strict=True):
        site, layer = _site(age, spacing=0.5)
        ground = shape_ground(site=site, window=site.window, layers=(layer,))
        axes.imshow(_shade(ground.elevation.astype(np.float64), 0.5), cmap="gray", vmin=0, vmax=1)
        axes.set_title(f"{age:g} Ga", fontsize=10)
        axes.set_axis_off()
    return figure


def _shade(elevation: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """Light of a low sun in the west, north up."""
    light = LightSource(azdeg=270, altdeg=15)
    shade: NDArray[np.float64] = light.hillshade(elevation[::-1], dx=spacing, dy=spacing)
    return shade


if __name__ == "__main__":
    main()
