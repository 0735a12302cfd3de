"""Draws docs/images/paths_*.png: each kind of route, and a planned path over its cost map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from terrain_forge.dtm import FlatDtm
from terrain_forge.making import plan
from terrain_forge.model import World
from terrain_forge.paths import (
    UNITS,
    FigureEight,
    Lawnmower,
    Loop,
    PathSpec,
    Planned,
    Polyline,
    RouteSpec,
    Spiral,
    Spline,
    Triangle,
    plan_route,
)
from terrain_forge.pipeline import realise
from terrain_forge.recipe import Recipe, TerrainSpec
from terrain_forge.rocks import Golombek, LibrarySpec, PopulationSpec, RocksSpec
from terrain_forge.rovers import find_rover
from terrain_forge.terrain import Fractal
from terrain_forge.truth import rate_world

IMAGES = Path(__file__).parent / "images"
POINTS = ((-5.0, -3.0), (0.0, -4.0), (4.0, 0.0), (-1.0, 4.0))
SHAPES: dict[str, RouteSpec] = {
    "spline": Spline(points_m=POINTS),
    "polyline": Polyline(points_m=POINTS),
    "polyline, corner_radius_m: 1.5": Polyline(points_m=POINTS, corner_radius_m=1.5),
    "loop, aspect: 0.6": Loop(length_m=30.0, aspect=0.6),
    "triangle": Triangle(length_m=30.0),
    "lawnmower": Lawnmower(length_m=50.0, rows=5, row_spacing_m=1.8),
    "spiral": Spiral(length_m=50.0),
    "figure_eight": FigureEight(length_m=30.0, orientation_deg=20.0),
}


def main() -> None:
    """Write the pictures."""
    _save(_shapes(), "shapes")
    _save(_planned(), "planned")


def _save(figure: Figure, name: str) -> None:
    FigureCanvasAgg(figure)
    figure.savefig(IMAGES / f"paths_{name}.png", metadata={"Software": None})


def _shapes() -> Figure:
    """Every named shape, its start, and where the rover turns on the spot."""
    figure = Figure(figsize=(10, 5.4), dpi=100, layout="constrained")
    rover = find_rover("morpheus")
    for axes, (title, route) in zip(figure.subplots(2, 4).flat, SHAPES.items(), strict=True):
        spec = PathSpec(name="p", route=route, speed_m_s=0.4)
        line = plan_route(spec, rover=rover, driven=False)
        axes.plot(*line.position.T, color="#b5502f", lw=1.8)
        axes.plot(*line.position[0], "o", color="#22577a", ms=6)
        axes.plot(*line.position[line.turns[:, 0]].T, "s", color="#38a3a5", ms=6)
        axes.set_title(f"{title}\n{line.length:.2f} m", fontsize=9)
        axes.set(aspect="equal", xlim=(-7.2, 7.2), ylim=(-6, 6))
        axes.tick_params(labelsize=7)
        axes.grid(alpha=0.25)
    return figure


def _world() -> World:
    everywhere = PopulationSpec(
        name="rocks", size_frequency=Golombek(k=0.14), diameter_m=(0.2, 3.0)
    )
    route = Planned(start_m=(-20.0, -13.0), goal_m=(18.0, 13.5), via_m=((2.0, -6.0),))
    recipe = Recipe(
        name="figure",
        seed=12,
        body="mars",
        dtm=FlatDtm(size_m=(48.0, 32.0)),
        terrain=TerrainSpec(spacing_m=0.125, layers=(Fractal(),)),
        rocks=RocksSpec(library=LibrarySpec(shapes=12, seed=7), populations=(everywhere,)),
        paths=(PathSpec(name="planned", route=route, speed_m_s=0.4),),
        exports=(),
    )
    return realise(plan(recipe))


def _planned() -> Figure:
    """The cost map with the outlines of rocks that MORPHEUS goes around, and the planned path."""
    world = _world()
    field = rate_world(world)
    figure = Figure(figsize=(10, 6.4), dpi=100, layout="constrained")
    axes: Axes = figure.subplots()
    west, south, east, north = world.ground.bounds
    half = 0.5 * world.ground.spacing
    image = axes.imshow(
        np.ma.masked_less(field.cost, 0.0),
        origin="lower",
        extent=(west - half, east + half, south - half, north + half),
        cmap="cividis",
        vmin=0.0,
        vmax=1.0,
    )
    for centre, support in zip(field.obstacles.centre, field.obstacles.support, strict=True):
        axes.plot(*(centre[:, None] + support * UNITS), color="#d1495b", lw=0.8)
    (path,) = world.trajectories
    axes.plot(*path.position[:, :2].T, color="white", lw=2.0)
    axes.plot(*path.position[[0, -1], :2].T, "o", color="white", ms=7)
    axes.plot(2.0, -6.0, "D", color="white", ms=6)
    axes.set(xlabel="east [m]", ylabel="north [m]", aspect="equal")
    figure.colorbar(image, ax=axes, label="cost (1: the rover's centre cannot be here)")
    return figure


if __name__ == "__main__":
    main()
