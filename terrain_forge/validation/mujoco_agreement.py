"""The exported MJCF seen through MuJoCo: heights and rocks by rays, gravity, the rover's mass."""

from __future__ import annotations

from copy import copy
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, SimulationError, matrix_from_quaternion
from terrain_forge.geometry import inertias
from terrain_forge.model import Check, Mesh, World, at_most, failed
from terrain_forge.validation.agreement import ground_check
from terrain_forge.validation.surface_mesh import heights_on

ROCKS = 200
"""How many rocks are looked at."""
ROCK_LIMIT = 0.01
"""A rock's top may be off by this part of its size, to which sizes are rounded: of its exposed
diameter, or of its mean axis where most of it is buried."""
MASS_LIMIT = 1e-6
"""A dynamic rock's mass and moments of inertia may be off by this part of them."""
_UPWARD = 0.3  # least cosine to the vertical of a face that a ray is sent down to
_GROUND_GROUPS, _ROCK_GROUPS = (0,), (1, 3)
"""Groups of the geoms that rays meet: of the ground, of rocks seen and hidden."""
_OTHERS = 5
"""Group of what rays onto the ground pass through."""


def mujoco_agreement(world: World, model: Any, name: str, at: Array) -> list[Check]:
    """Checks of a loaded world.xml or scene.xml against the world it was exported from.

    Args:
        world: The world.
        model: The MuJoCo model.
        name: The export's folder, for the checks' names.
        at: Points on the ground, shape [n, 2] [m].
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    gravity = abs(float(model.opt.gravity[2]) + world.site.body.gravity)
    return [
        ground_check(world, name, at, ground_heights(world, model, data, at)),
        *_rock_checks(world, model, data, name),
        *_mass_checks(world, model, name),
        at_most(f"{name}: gravity", gravity, 1e-6, unit="m/s²", note="difference to the body's"),
    ]


def ground_heights(world: World, model: Any, data: Any, at: Array) -> Array:
    """Heights [m] at which rays from above meet the ground that is touched; NaN where they miss."""
    fields = model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD
    touched = (model.geom_contype | model.geom_conaffinity) != 0
    asked = copy(model)
    asked.geom_group[:] = np.where(fields & touched, _GROUND_GROUPS[0], _OTHERS)
    sky = float(world.ground.elevation.max()) + 1.0
    return np.array([_ray(asked, data, (*p, sky), _GROUND_GROUPS)[0] for p in at])


def sample_model(world: World, folder: Path) -> Any:
    """The exported world.xml as MuJoCo loads it, with a sample of its rocks.

    Compiling a mesh for every rock would take longer than the whole build.

    Raises:
        SimulationError: if MuJoCo cannot load it.
    """
    wanted = {f"rock_{world.field.id[row]}" for row in _sampled_rows(world)}
    parser = ElementTree.XMLParser(target=_SampledTree(wanted))
    root = ElementTree.parse(folder / "world.xml", parser).getroot()
    body, asset = root.find("worldbody"), root.find("asset")
    if body is None or asset is None:
        raise SimulationError(f"{folder / 'world.xml'} has no ground")
    used = {geom.get("mesh") for geom in body.iter("geom")}
    asset[:] = [e for e in asset if e.tag != "mesh" or e.get("name") in used]
    names = {str(item.get("file")) for item in asset if item.get("file")}
    files = {name: (folder / name).read_bytes() for name in sorted(names)}
    try:
        text = ElementTree.tostring(root, encoding="unicode")
        return mujoco.MjModel.from_xml_string(text, files)
    except ValueError as error:
        raise SimulationError(f"{folder / 'world.xml'}: MuJoCo cannot load it: {error}") from None


class _SampledTree(ElementTree.TreeBuilder):
    """Builds the tree of a file without the rocks that are not looked at, which would fill it."""

    def __init__(self, wanted: set[str]) -> None:
        super().__init__()
        self._wanted = wanted
        self._left_out = 0

    def start(self, tag: str, attributes: dict[str, str], /) -> Any:
        """Open an element, unless it is of a rock that is left out or within one."""
        rock = _rock_of(attributes.get("name", "")) if tag in ("body", "geom") else ""
        if self._left_out or (rock and rock not in self._wanted):
            self._left_out += 1
            return None
        return super().start(tag, attributes)

    def end(self, tag: str, /) -> Any:
        """Close an element."""
        if self._left_out:
            self._left_out -= 1
            return None
        return super().end(tag)


def _rock_of(geom: str) -> str:
    """The rock `rock_<id>` that a geom or body `rock_<id>…` belongs to; empty for what is none."""
    return "_".join(geom.split("_")[:2]) if geom.startswith("rock_") else ""


def _sampled_rows(world: World) -> NDArray[np.int64]:
    """Rows of the colliding rocks to look at: evenly over all, dynamic ones, and the largest."""
    solid = np.flatnonzero(world.field.collides)
    largest = solid[np.argsort(world.field.diameter[solid], kind="stable")[-1:]]
    dynamic = np.flatnonzero(world.field.collides & world.field.dynamic)
    return np.unique(np.concatenate([_spread(solid), _spread(dynamic), largest]))


def _spread(rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Some of the rows, evenly over them."""
    places = np.linspace(0, len(rows) - 1, min(ROCKS, len(rows))).round().astype(np.int64)
    return rows[places]


def _rock_checks(world: World, model: Any, data: Any, name: str) -> list[Check]:
    """Tops of rocks on a wide high face, and that they are the rocks' own."""
    rows = _sampled_rows(world)
    if not len(rows):
        return []
    worst = 0.0
    for row in rows:
        x, y, top = _top(world, int(row))
        height, geom = _ray(model, data, (x, y, top + 1.0), _ROCK_GROUPS)
        rock = f"rock_{world.field.id[row]}"
        own = geom >= 0 and _rock_of(model.geom(geom).name) == rock
        if not own and height > top:
            continue  # another rock hangs over it, which is not this check's business
        if not own:
            return [failed(f"{name}: rocks", f"{rock} is not where it should be")]
        size = max(float(world.field.diameter[row]), float(world.field.scale[row]))
        worst = max(worst, abs(height - top) / size)
    note = f"largest difference of tops in sizes, {len(rows)} rocks"
    return [at_most(f"{name}: rocks", worst, ROCK_LIMIT, note=note)]


def _mass_checks(world: World, model: Any, name: str) -> list[Check]:
    """Masses and moments of inertia of the dynamic rocks among the sampled ones."""
    rows = [row for row in _sampled_rows(world) if world.field.dynamic[row]]
    if not rows:
        return []
    field = world.field.select(np.array(rows))
    bodies = [model.body(f"rock_{rock}") for rock in field.id]
    moments = np.linalg.eigvalsh(inertias(field, world.library))
    found = np.sort([body.inertia for body in bodies], axis=1)
    off_mass = np.abs([body.mass[0] for body in bodies] / field.mass - 1.0).max()
    off = max(float(off_mass), float(np.abs(found / moments - 1.0).max()))
    note = f"largest relative difference of mass and moments of inertia, {len(rows)} rocks"
    return [at_most(f"{name}: dynamic rocks", off, MASS_LIMIT, note=note)]


def _top(world: World, row: int) -> Array:
    """Where a rock's collision hulls are, under the middle of a wide high face [m], shape [3].

    Its centre of mass will not do, over which a bent rock has no height, nor a narrow face, which
    a rounded size moves from under its middle.
    """
    field = world.field
    turned = matrix_from_quaternion(field.quaternion[row]) * field.scale[row]
    placed = [
        Mesh(vertices=hull.vertices @ turned.T + field.position[row], faces=hull.faces)
        for hull in world.library.prototypes[field.prototype[row]].hulls
    ]
    corners = np.concatenate([hull.vertices[hull.faces] for hull in placed])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    upward = normals[:, 2] > _UPWARD * np.linalg.norm(normals, axis=1)
    middles = corners.mean(axis=1)[upward]
    rise = middles[:, 2] - corners[..., 2].min()
    middle = middles[np.argmax(normals[upward, 2] * rise)]
    # A part that does not lie there has no height.
    top = np.nanmax([heights_on(hull, middle[None, :2])[0] for hull in placed])
    return np.array([*middle[:2], top])


def _ray(
    model: Any, data: Any, start: tuple[float, ...], shown: tuple[int, ...]
) -> tuple[float, int]:
    """Height [m] and geom that a ray straight down meets first; NaN and -1 if none."""
    geom = np.full(1, -1, dtype=np.int32)
    groups = np.isin(np.arange(6), shown).astype(np.uint8)
    down = np.array([0.0, 0.0, -1.0])
    distance = mujoco.mj_ray(model, data, np.array(start), down, groups, 1, -1, geom)
    return (start[2] - distance, int(geom[0])) if distance >= 0 else (float("nan"), -1)
