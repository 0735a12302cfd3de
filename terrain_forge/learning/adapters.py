"""Our ground for the terrain generators of mjlab and Isaac Lab, and as height fields of MuJoCo.

Neither package is imported: their generators call a function and take what it returns. mjlab calls
`function(difficulty, spec, rng)` of a configuration and takes an origin and geoms
(`mjlab.terrains.terrain_generator`); Isaac Lab calls `function(difficulty, cfg)` and takes meshes
and an origin (`isaaclab.terrains.sub_terrain_cfg`). Both want ground from (0, 0) to its size.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge

from terrain_forge import __version__
from terrain_forge.base import (
    Array,
    DataError,
    NotNegative,
    PositivePair,
    RecipeError,
    Stopwatch,
    checked,
    dotted,
    require_kind,
    silent,
    stage_key,
)
from terrain_forge.geometry import grid_faces, grid_vertices
from terrain_forge.making import make_world
from terrain_forge.model import World, rotations
from terrain_forge.recipe import (
    ArrivalSpec,
    DifficultySpec,
    Recipe,
    RecipeFile,
    WorldsSpec,
    input_paths,
    recipe_json,
    require_fits,
)
from terrain_forge.truth import rock_rasters
from terrain_forge.variation import draw

_PRIORITY = 2
"""Of the ground's contacts, above those that a robot's geoms may have, as the MJCF export has it:
MuJoCo takes the larger friction of two geoms of one priority."""
_Number = Annotated[int, Ge(0)]
"""Of a world, or a seed."""


@dataclass(frozen=True, kw_only=True)
class GroundMaker:
    """Worlds of a recipe by difficulty and number, for the generators of other packages.

    They have no paths: masks by the distance to one are as they are far away from any.
    """

    recipe: Recipe
    """With `worlds.difficulty`, or the usual one."""
    folder: Path = Path()
    """What the recipe's paths are relative to."""
    platform: float = 0.5
    """Radius [m] around the middle, above whose highest point a robot is set."""

    @staticmethod
    @checked
    def of(file: RecipeFile, *, platform: NotNegative = 0.5) -> GroundMaker:
        """The maker of a recipe that was read from a file.

        Raises:
            DataError: for another kind of argument.
        """
        return GroundMaker(recipe=file.recipe, folder=file.folder, platform=platform)

    @checked
    def world(
        self, difficulty: float, number: _Number, *, size: PositivePair | None = None
    ) -> World:
        """A world of a difficulty, 0 to 1, and a number; of another size than the recipe's.

        Raises:
            ValueError: for another difficulty.
            DataError: for another kind of argument.
            RecipeError: if such a world cannot be.
        """
        if not 0.0 <= difficulty <= 1.0:
            raise ValueError(f"difficulty: {difficulty:g}, allowed: 0 to 1")
        recipe, number = self.recipe, int(number)
        if size is not None:
            sides = float(size[0]), float(size[1])
            recipe = replace(recipe, dtm=replace(recipe.dtm, size_m=sides))
        spec = recipe.worlds or WorldsSpec()
        wish = spec.difficulty or DifficultySpec()
        # How far goals are is not looked at, lest a small world had none.
        recipe = replace(recipe, worlds=replace(spec, difficulty=wish, arrival=ArrivalSpec()))
        level, folder = float(difficulty), self.folder
        try:
            site = draw(recipe, number, folder=folder, difficulty=level, paths=False).site
            require_fits(site)
        except (RecipeError, DataError) as error:  # other packages show no keys
            told = ": ".join(filter(None, [dotted(error.key), str(error)]))
            raise type(error)(told, key=error.key) from None
        return make_world(site, site.window, settled=True, progress=Stopwatch(silent))

    @checked
    def mjlab(
        self,
        difficulty: float,
        spec: Any,
        rng: np.random.Generator,
        *,
        size: PositivePair | None = None,
    ) -> Any:
        """What mjlab's `SubTerrainCfg.function` does: geoms in `spec`, and the origin.

        Returns:
            `origin`, an array of 3, and `geometries`, the geoms; where mjlab is installed as its
            `TerrainOutput`.

        Raises:
            ValueError, DataError, RecipeError: as `world`.
        """
        _require_spec(spec)
        world = self.world(difficulty, int(rng.integers(2**31)), size=size)
        geom, field = add_to_spec(spec, world, name=f"ground_{rng.integers(2**63)}")
        origin = self.origin_of(world)
        try:
            from mjlab.terrains.terrain_generator import (  # type: ignore[import-not-found]
                TerrainGeometry,
                TerrainOutput,
            )
        except ImportError:
            return origin, [geom]
        told = TerrainGeometry(geom=geom, hfield=field)
        return TerrainOutput(origin=origin, geometries=[told])

    @property
    def isaac_lab(self) -> ForIsaacLab:
        """What Isaac Lab's `SubTerrainBaseCfg.function` is to be."""
        return ForIsaacLab(self)

    def origin_of(self, world: World) -> Array:
        """The middle of the ground, as high as what stands about it, from the corner [m]."""
        top, ground = rock_rasters(world)[0], world.ground
        west, south, _, _ = ground.bounds
        reach = self.platform + np.sqrt(2.0) * ground.spacing  # of cells that lie in it in part
        near = np.hypot(ground.east[None, :], ground.north[:, None]) <= reach
        return np.array([-west, -south, float(top[near].max())])


@dataclass(frozen=True, slots=True)
class ForIsaacLab:
    """What Isaac Lab calls.

    Its cache of terrains tells functions apart by their names alone: this one's hangs on the
    recipe, and on when the files that it names were written.
    """

    maker: GroundMaker

    @property
    def __name__(self) -> str:
        maker = self.maker
        told = [__version__, recipe_json(maker.recipe), str(maker.platform)]
        for path in input_paths(maker.recipe, maker.folder):
            told.append(f"{path.resolve()} {path.stat().st_mtime_ns if path.exists() else 0}")
        return f"isaac_lab_{sha256(repr(told).encode()).hexdigest()[:16]}"

    @checked
    def __call__(self, difficulty: float, cfg: Any) -> tuple[list[Any], Array]:
        """Meshes of trimesh and the origin, for a difficulty of 0 to 1 and a configuration.

        The number of the world hangs on the difficulty, which differs from place to place, and the
        generator's seed, which is that of NumPy's global state where it has none: so Isaac Lab's
        cache of terrains holds what is made anew.

        Raises:
            ValueError, DataError, RecipeError: as `GroundMaker.world`.
        """
        size, seed = getattr(cfg, "size", None), getattr(cfg, "seed", None)
        require_kind(size, PositivePair, "cfg.size")
        require_kind(seed, _Number | None, "cfg.seed")
        if seed is None:
            seed = int(np.random.get_state()[1][0])  # type: ignore[index]  # noqa: NPY002
        number = int(stage_key(int(seed), f"isaac_lab/{float(difficulty)!r}")) % 2**31
        world = self.maker.world(difficulty, number, size=size)
        return trimeshes(world), self.maker.origin_of(world)


@checked
def trimeshes(world: World) -> list[Any]:
    """Ground and rocks as trimesh meshes, whose south-west corner is (0, 0).

    Raises:
        DataError: for what is no world.
    """
    import trimesh

    west, south, _, _ = world.ground.bounds
    ground = world.ground
    meshes = [trimesh.Trimesh(grid_vertices(ground), grid_faces(*ground.shape), process=False)]
    shapes = [shape.meshes[min(1, len(shape.meshes) - 1)] for shape in world.library.prototypes]
    field = world.field.select(world.field.collides)
    vertices, faces, count = [], [], 0
    for turn, scale, place, n in zip(
        rotations(field), field.scale, field.position, field.prototype, strict=True
    ):
        vertices.append(scale * shapes[n].vertices @ turn.T + place)
        faces.append(shapes[n].faces + count)
        count += len(vertices[-1])
    if count:
        rocks = trimesh.Trimesh(np.concatenate(vertices), np.concatenate(faces), process=False)
        meshes.append(rocks)
    for mesh in meshes:
        mesh.apply_translation((-west, -south, 0.0))
    return meshes


@checked
def add_to_spec(
    spec: Any,
    world: World,
    *,
    name: str = "ground",
    body: str = "terrain",
    own_frame: bool = False,
) -> tuple[Any, Any]:
    """Add a world's ground, with its rocks in it, to a `mujoco.MjSpec` as one height field.

    MuJoCo Warp, MJX and Newton know height fields of MuJoCo; of rocks such a field has what stands
    above its nodes, without overhangs. Its contacts have the friction of the body's regolith,
    whatever touches it; rocks and materials have none of their own.

    Args:
        spec: Such as `mujoco.MjSpec()`.
        world: The world.
        name: Of the field and its geom.
        body: Body that the geom belongs to; made where there is none.
        own_frame: Whether the body's origin is the world's, in which its paths and rocks are told;
            otherwise it is the ground's south-west corner, at the world's height 0.

    Returns:
        The geom and the field.

    Raises:
        DataError: for another kind of argument, or a name that the spec has already.
    """
    import mujoco

    _require_spec(spec)
    if not name or spec.hfield(name) or spec.geom(name):
        raise DataError(f"add_to_spec: name must be one that the spec has not yet, found {name!r}")
    owner = spec.body(body) or spec.worldbody.add_body(name=body)
    top, (west, south, east, north) = rock_rasters(world)[0], world.ground.bounds
    lowest, highest = float(top.min()), float(top.max())
    extent = max(highest - lowest, 1e-3)
    half = 0.5 * (east - west), 0.5 * (north - south)
    corner = (west, south) if own_frame else (0.0, 0.0)
    field = spec.add_hfield(
        name=name,
        size=[*half, extent, 1.0],
        nrow=top.shape[0],
        ncol=top.shape[1],
        userdata=((top - lowest) / extent).astype(np.float32).ravel(),
    )
    geom = owner.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname=name,
        pos=[half[0] + corner[0], half[1] + corner[1], lowest],
        friction=[world.site.body.friction.regolith.coefficient, 0.005, 0.0001],
        priority=_PRIORITY,
    )
    return geom, field


def _require_spec(spec: Any) -> None:
    import mujoco

    if not isinstance(spec, mujoco.MjSpec):
        raise DataError(f"spec must be a mujoco.MjSpec, found a {type(spec).__name__}")
