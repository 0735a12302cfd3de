"""A curriculum as one scene: rows of rising difficulty, columns of variants, flat borders."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    OutputError,
    Progress,
    RecipeError,
    Stopwatch,
    TerrainForgeError,
    dotted,
    resolved,
    silent,
    warn_user,
)
from terrain_forge.building import replacing, require_ours, write_export, write_manifest
from terrain_forge.dtm import FlatDtm
from terrain_forge.making import make_world, plan
from terrain_forge.model import Heightfield, RockField, Site, World
from terrain_forge.recipe import (
    MOST_WORLDS,
    OF_PATHS,
    DifficultySpec,
    ExportOrder,
    Recipe,
    RecipeFile,
    Variation,
    WorldsSpec,
    given_recipe,
    machine_memory,
    memory_needed,
    recipe_json,
    require_exports,
    value_at,
    without_paths,
)
from terrain_forge.rocks import RocksSpec
from terrain_forge.truth import write_truth
from terrain_forge.variation.drawing import draw, require_drawable, require_untiled
from terrain_forge.variation.mosaic import Mosaic
from terrain_forge.variation.series import orders_of
from terrain_forge.variation.summary import summary_of

BORDER = 4.0
"""Width of the border between worlds of a grid at least, unless it is given [m]."""
FLAT = 1.0
"""Half of the flat middle of a border, or a quarter of a narrow border [m]."""
STEEPEST = 20.0
"""Slope from a world's edge to the middle of a border [degrees] that a wide enough one has."""
_STEEPER = 1.5
"""Steepest slope of a border over its mean one."""
_COMMON = (
    *(("body",), ("rover",), ("sensors",), ("sun",), ("sky",)),
    *(("rocks", "library"), ("dtm", "size_m"), ("terrain", "spacing_m")),
    ("terrain", "appearance", "detail"),
)
"""What a scene has once."""


def make_grid(
    recipe: Recipe | RecipeFile | Path | str,
    out: Path | str,
    *,
    shape: tuple[int, int],
    folder: Path | str = ".",
    only: tuple[str, ...] | str | None = None,
    border: float | None = None,
    progress: Progress = silent,
) -> Path:
    """Make rows of rising difficulty × columns of variants as one scene; returns its folder.

    Row 0 is the southern one, of the least difficulty of `worlds.difficulty`. The worlds lie as
    they are made alone, each moved up or down so that its edge lies at 0 on average; borders slope
    from their edges to 0. `grid.json` tells where each is, what was drawn for it and how steeply
    its border falls; a warning tells of more than 20°.

    Args:
        recipe: What to make, or its file.
        out: Folder; an older world of ours is replaced.
        shape: Rows and columns.
        folder: What the recipe's paths are relative to; of a file, its own folder.
        only: Folders of the exports to write; by default all of the recipe.
        border: Width of the border [m]; by default 4 m, or as many as make none steeper than 20°,
            up to twice the shorter side of a world and what there is room for.
        progress: Called with the share that is made.

    Raises:
        RecipeError, DataError, OutputError, StorageError: as `build`; also for a scene of more
            worlds than a series has, or that does not fit into memory or a format.
    """
    recipe, folder = given_recipe(recipe, folder)
    folder = resolved(folder)
    out = resolved(out)
    require_ours(out)
    require_untiled(recipe)
    _require_fits(recipe, shape, _margin(recipe, border or BORDER))
    orders_of(recipe, only)  # refuses what no export has
    recipe = replace(recipe, worlds=_without_common(recipe.worlds or WorldsSpec()))
    orders = orders_of(without_paths(recipe), only)
    require_drawable(recipe, folder)
    whole, cells = _assembled(recipe, folder, shape, border, orders, progress)
    with replacing(out) as directory:
        exports = tuple(write_export(whole, directory, order) for order in orders)
        write_truth(whole, directory, figures=False)
        whole.save(directory)
        steepest = max(cell["border_slope_deg"] for cell in cells)
        told = {"rows": shape[0], "columns": shape[1], "steepest_border_deg": steepest}
        text = json.dumps({**told, "worlds": cells}, indent=1)
        (directory / "grid.json").write_text(text + "\n", encoding="utf-8")
        write_manifest(whole.site, directory, exports=exports)
    return out


def _margin(recipe: Recipe, border: float) -> int:
    """Cells of half a border."""
    return max(round(0.5 * border / recipe.terrain.spacing_m), 1)


def _wide(height: float, spacing: float) -> float:
    """The least border [m] that falls gently from an edge of a height."""
    return 2.0 * (_STEEPER * height / math.tan(math.radians(STEEPEST)) + FLAT + spacing)


def _warn_of_cliffs(steepest: float, border: float, enough: float) -> None:
    """Tell of borders that fall more steeply than they need to."""
    if steepest > STEEPEST:
        warn_user(
            f"borders of {border:.3g} m between the worlds of the grid fall by up to "
            f"{steepest:.0f}°: {enough:.3g} m would be gentler than {STEEPEST:g}°"
        )


def _slope(height: float, margin: int, spacing: float) -> float:
    """How steeply a border falls from an edge of a height, at most [degrees]."""
    return math.degrees(math.atan(_STEEPER * height / (_fall(margin, spacing) * spacing)))


def _fall(margin: int, spacing: float) -> float:
    """Cells from a world's edge to the flat middle of its border."""
    return max(margin - FLAT / spacing, 0.5 * margin, 1.0)


def _require_fits(recipe: Recipe, shape: tuple[int, int], margin: int) -> None:
    """Refuse a scene of too many worlds, or one that would not fit into this machine's memory."""
    rows, columns = shape
    told = f"a grid of {rows:,} × {columns:,} worlds"
    if not (rows > 0 and columns > 0 and rows * columns <= MOST_WORLDS):
        raise OutputError(f"{told}: 1 to {MOST_WORLDS:,} in all")
    across, up = _cells(recipe, margin)
    nodes = float(columns * across + 1) * float(rows * up + 1)
    needed, there = memory_needed(nodes, 0.0), machine_memory()
    if needed > there:
        raise OutputError(
            f"{told} is a scene of {nodes:.3g} nodes, which needs about {needed / 1e9:.3g} GB of "
            f"memory, this machine has {there / 1e9:.3g} GB: ask for fewer, or for worlds apart "
            "with --count"
        )


def _cells(recipe: Recipe, margin: int) -> tuple[int, int]:
    """Cells of a world with its border, east and north."""
    east, north = (round(side / recipe.terrain.spacing_m) for side in recipe.dtm.size_m)
    return east + 2 * margin, north + 2 * margin


def _scene(
    recipe: Recipe,
    folder: Path,
    shape: tuple[int, int],
    margin: int,
    orders: tuple[ExportOrder, ...],
) -> Site:
    """The site of the whole scene, which has nothing of its own.

    Raises:
        OutputError, RecipeError: if it does not fit into memory, or a format.
    """
    _require_fits(recipe, shape, margin)
    (across, up), spacing = _cells(recipe, margin), recipe.terrain.spacing_m
    site = plan(
        replace(
            without_paths(recipe),
            name=f"{recipe.name}-grid",
            dtm=FlatDtm(size_m=(shape[1] * across * spacing, shape[0] * up * spacing)),
            terrain=replace(recipe.terrain, layers=()),
            rocks=RocksSpec(library=recipe.rocks.library),
            worlds=None,
        ),
        folder=folder,
    )
    require_exports(orders, site)
    return site


def _assembled(
    recipe: Recipe,
    folder: Path,
    shape: tuple[int, int],
    border: float | None,
    orders: tuple[ExportOrder, ...],
    progress: Progress,
) -> tuple[World, list[dict[str, Any]]]:
    """The world of all, and what each of its parts is."""
    rows, columns = shape
    spacing = recipe.terrain.spacing_m
    wide = border or BORDER
    site = _scene(recipe, folder, shape, _margin(recipe, wide), orders)
    made = []
    for one in _worlds(recipe, folder, shape):
        made.append(one)
        progress("worlds", len(made) / (rows * columns))
    highest = [_lifted(world.ground.elevation)[1] for world, *_ in made]
    enough = _wide(max(highest), spacing)
    if border is None and enough > wide:
        wider = max(wide, min(enough, 2.0 * min(recipe.dtm.size_m)))
        with suppress(TerrainForgeError):  # there is no room for it
            site = _scene(recipe, folder, shape, _margin(recipe, wider), orders)
            wide = wider
    margin = _margin(recipe, wide)
    across, up = _cells(recipe, margin)
    slopes = [round(_slope(height, margin, spacing), 1) for height in highest]
    _warn_of_cliffs(max(slopes), wide, enough)
    elevation = np.zeros((rows * up + 1, columns * across + 1), np.float32)
    looks, cells, number = Mosaic(elevation.shape), [], 0
    fields: list[RockField] = []
    missed: list[RockField] = []
    first: World | None = None
    for (world, summary, row, column), slope in zip(made, slopes, strict=True):
        first = first or world
        place = (
            slice(row * up, (row + 1) * up + 1),
            slice(column * across, (column + 1) * across + 1),
        )
        lifted, rise = _with_border(world.ground.elevation, margin, spacing)
        elevation[place] = lifted
        middle = (
            site.west + (column + 0.5) * across * spacing,
            site.south + (row + 0.5) * up * spacing,
        )
        kinds = looks.add(world, place, margin)
        for rocks, all_rocks in ((world.field, fields), (world.unsupported, missed)):
            if rocks is not None:
                moved = rocks.replace(
                    id=number + np.arange(len(rocks), dtype=np.int32),
                    population=kinds[rocks.population],
                    position=rocks.position + np.array([*middle, rise]),
                )
                all_rocks.append(moved)
                number += len(rocks)
        height = float(world.ground.height_at(0.0, 0.0)) + rise
        place_of = {"row": row, "column": column, "origin_m": [*middle, height]}
        cells.append({**place_of, "border_slope_deg": slope, **summary})
    assert first is not None  # a grid has a world
    named = {"populations": looks.populations}
    field = fields[0].joined(*fields[1:]).replace(**named)
    unsupported = missed[0].joined(*missed[1:]).replace(**named) if missed else None
    return (
        World(
            site=site,
            window=site.window,
            ground=Heightfield(
                elevation=elevation, spacing=spacing, origin=(site.west, site.south)
            ),
            appearance=looks.appearance(first.appearance.detail),
            library=first.library,
            field=field,
            neighbours=field.select(np.zeros(len(field), np.bool_)),
            trajectories=(),
            rover=first.rover,
            lighting=first.lighting,
            unplaced=looks.unplaced,
            unsupported=unsupported,
        ),
        cells,
    )


def _worlds(
    recipe: Recipe, folder: Path, shape: tuple[int, int]
) -> Iterator[tuple[World, dict[str, Any], int, int]]:
    """Each world with what was drawn for it, its row and its column."""
    spec = recipe.worlds or WorldsSpec()
    wish = spec.difficulty or DifficultySpec()
    recipe = replace(recipe, worlds=replace(spec, difficulty=wish))
    low, high = wish.level if isinstance(wish.level, tuple) else (wish.level, wish.level)
    rows, columns = shape
    for row in range(rows):
        level = low + (high - low) * (row / (rows - 1) if rows > 1 else 0.5)
        for column in range(columns):
            number = row * columns + column
            drawn = draw(recipe, number, folder=folder, difficulty=level, paths=False)
            _require_common(drawn.recipe, without_paths(recipe))
            site = drawn.site
            world = make_world(site, site.window, settled=True, progress=Stopwatch(silent))
            yield world, summary_of(drawn, world, spec.arrival), row, column


def _without_common(spec: WorldsSpec) -> WorldsSpec:
    """The wishes that worlds of one scene can have; warns of the others."""
    varied: dict[str, Variation | Literal["anywhere"]] = {}
    for name, wish in spec.vary.items():
        steps = tuple(name.split("."))
        once = next((key for key in _COMMON if steps[: len(key)] == key), None)
        if steps[0] in OF_PATHS:
            warn_user(f"worlds.vary.{name} has no effect: a grid has no paths")
        elif once is None:
            varied[name] = wish
        else:
            warn_user(
                f"worlds.vary.{name} is the same in all of a grid, which has one {dotted(once)}: "
                "the recipe's"
            )
    return replace(spec, vary=varied)


def _require_common(own: Recipe, recipe: Recipe) -> None:
    """Refuse a world that differs from the recipe in what a scene has once.

    Raises:
        RecipeError: names the key.
    """
    one, other = (json.loads(recipe_json(each)) for each in (recipe, own))
    for key in _COMMON:
        found = [value_at(plain, key) for plain in (one, other)]
        if found[0] != found[1]:
            told = " and ".join(json.dumps(value)[:60] for value in found)
            raise RecipeError(
                f"all worlds of a grid have one {dotted(key)}, found {told}: leave it as it is, "
                "or ask for worlds apart with --count",
                key=("worlds", "vary"),
            )


def _lifted(elevation: NDArray[np.float32]) -> tuple[float, float]:
    """How far a world is raised so that its edge lies at 0 on average, and how far it is off it."""
    edge = np.concatenate([elevation[0], elevation[-1], elevation[:, 0], elevation[:, -1]])
    rise = -float(edge.astype(np.float64).mean())
    return rise, float(np.abs(edge + rise).max())


def _with_border(heights: NDArray[np.float32], margin: int, spacing: float) -> tuple[Array, float]:
    """Heights with a border that falls to 0, and how far the middle was raised [m]."""
    elevation, (rise, _) = heights.astype(np.float64), _lifted(heights)
    padded = np.pad(elevation + rise, margin, mode="edge")
    rows, columns = elevation.shape
    far = [
        np.maximum(np.maximum(-n, n - (nodes - 1)), 0.0)
        for nodes in (rows, columns)
        for n in [np.arange(-margin, nodes + margin, dtype=np.float64)]
    ]
    part = np.minimum(np.sqrt(far[0][:, None] ** 2 + far[1] ** 2) / _fall(margin, spacing), 1.0)
    return padded * (1.0 - part * part * (3.0 - 2.0 * part)), rise
