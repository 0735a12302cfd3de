"""MJCF worlds in MuJoCo: rays onto the ground, the rocks' geoms, bodies, beads of the paths."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator
from copy import copy
from functools import partial
from pathlib import Path
from shlex import quote
from typing import Any
from xml.etree import ElementTree

import numpy as np

from terrain_forge.base import (
    Array,
    Mask,
    SimulationError,
    load_model,
    matrix_from_quaternion,
    silent_mujoco,
)
from terrain_forge.model import Opening
from terrain_forge.validation import (
    BACKDROP,
    SETTLING,
    Body,
    Consumer,
    Reading,
    Sample,
    SolidsOfRocks,
    Track,
    newton,
    rock_of,
    table_columns,
    track_of,
)

_BEAD = re.compile(r"(.+)_\d+")
_SCALE_ERROR = 0.01
"""What sizes of rocks are rounded by, at the most."""
_DRAWN_LEVEL = 1
"""The level of detail that rocks are drawn by."""
_BALL = """<body name="probe_ball_{n}" pos="{x:.17g} {y:.17g} {z:.17g}">
<joint type="slide" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="{i:.17g} {i:.17g}
{i:.17g}"/><geom type="sphere" size="{r:.17g}"/></body>"""
_MESHES = 4000
"""How many rocks' meshes are compiled at a time: each takes 150 kB, however small it is."""
_GROUND, _OTHERS = 0, 5
"""Groups of what rays meet, and of what they pass through."""


@silent_mujoco()
def read_mjcf(sample: Sample, folder: Path, options: Any, scratch: Path) -> Reading:
    """An MJCF export as MuJoCo compiles it, all of it, with balls that come to rest in it.

    All of it is scene.xml, with rover and paths, where there is one. For a quick sample only its
    rocks are compiled: all of them would take longer than a build. Where each rock has meshes of
    its own, some are compiled after the others, to be seen to load.

    Raises:
        SimulationError: if MuJoCo cannot load it.
    """
    import mujoco

    del options, scratch
    scene, world = folder / "scene.xml", folder / "world.xml"
    whole = scene if scene.is_file() else world
    batches = [] if sample.quick else _batches(folder)
    bodies: dict[int, Body] = {}
    try:
        for rocks in batches:
            bodies |= _bodies(*_at_start(_load_sampled(rocks, folder)))
        model, data = _at_start(
            _load_sampled(sample.rocks, folder) if sample.quick or batches else load_model(whole)
        )
    except ValueError as error:
        raise SimulationError(f"MuJoCo cannot load {whole.name}: {error}") from None
    touched = (model.geom_contype | model.geom_conaffinity) != 0
    read = partial(
        Reading,
        consumer=f"MuJoCo {mujoco.__version__}",
        heights=_ground_heights(sample, model, data),
        touched=_solids(sample, model, data, touched),
        rock_error=_SCALE_ERROR,
        drawn_level=_DRAWN_LEVEL,
        gravity=float(model.opt.gravity[2]),
        bodies=bodies | _bodies(model, data),
    )
    if sample.quick:
        return read()
    return read(
        extent=_extent(model, data),
        seen=_solids(sample, model, data, model.geom_group < 3),  # viewers hide others
        balls=_rest(sample, folder),
        findings=tuple(f"warning {n}" for n in np.flatnonzero(data.warning.number).tolist()),
        tracks=tuple(_tracks(sample, folder)),
    )


def _at_start(model: Any) -> tuple[Any, Any]:
    """A model, and its bodies as they stand at first."""
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data


def _batches(folder: Path) -> list[list[int]]:
    """The rocks of world.xml in as many parts as are compiled one by one; none where all are."""
    root = ElementTree.parse(folder / "world.xml").getroot()
    parts = math.ceil(len(root.findall("asset/mesh")) / _MESHES)
    named = (rock_of(e.get("name", "")) for e in root.iterfind("worldbody//"))
    rocks = sorted({rock for rock in named if rock is not None})
    return [rocks[n::parts] for n in range(parts)] if parts > 1 else []


def _load_sampled(rocks: Collection[int], folder: Path, more: str = "") -> Any:
    """The model of world.xml with some of its rocks alone, and more bodies."""
    import mujoco

    root = ElementTree.parse(folder / "world.xml").getroot()
    body, asset = root.find("worldbody"), root.find("asset")
    if body is None or asset is None:
        raise SimulationError("world.xml has no ground")
    kept = {None, *rocks}
    for parent in (body, *body.findall(".//body")):
        parent[:] = [e for e in parent if rock_of(e.get("name", "")) in kept]
    body[:] = [e for e in body if e.get("name") not in BACKDROP]  # it takes longer than some rocks
    used = {geom.get("mesh") for geom in body.iter("geom")}
    asset[:] = [e for e in asset if e.tag != "mesh" or e.get("name") in used]
    body.extend(ElementTree.fromstring(f"<bodies>{more}</bodies>"))
    names = {str(item.get("file")) for item in asset if item.get("file")}
    files = {name: (folder / name).read_bytes() for name in sorted(names)}
    return mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"), files)


def _ground_heights(sample: Sample, model: Any, data: Any) -> Array:
    """Heights [m] at which rays from above meet the ground that is touched; NaN where they miss."""
    import mujoco

    fields = model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD
    touched = (model.geom_contype | model.geom_conaffinity) != 0
    asked = copy(model)
    asked.geom_group[:] = np.where(fields & touched, _GROUND, _OTHERS)
    groups = (np.arange(6) == _GROUND).astype(np.uint8)
    sky = float(sample.world.ground.elevation.max()) + 1.0
    down, geom = np.array([0.0, 0.0, -1.0]), np.zeros(1, np.int32)
    starts = [np.array([x, y, sky]) for x, y in sample.points]
    far = [mujoco.mj_ray(asked, data, start, down, groups, 1, -1, geom) for start in starts]
    return np.where(np.array(far) >= 0, sky - np.array(far), np.nan)


def _extent(model: Any, data: Any) -> tuple[float, float, float, float] | None:
    """West, south, east and north edge of all height fields [m]."""
    import mujoco

    fields = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD)
    if not len(fields):
        return None
    middle, half = data.geom_xpos[fields, :2], model.hfield_size[model.geom_dataid[fields], :2]
    west, south = (middle - half).min(axis=0).tolist()
    east, north = (middle + half).max(axis=0).tolist()
    return west, south, east, north


def _solids(sample: Sample, model: Any, data: Any, geoms: Mask) -> SolidsOfRocks:
    """The vertices of the rocks' mesh geoms, as far as they are among these."""
    import mujoco

    solids = SolidsOfRocks(sample.rocks)
    meshes = model.geom_type == mujoco.mjtGeom.mjGEOM_MESH
    for n in np.flatnonzero(meshes & geoms).tolist():
        rock = rock_of(model.geom(n).name)
        if rock is None or not solids.wants(rock):
            continue
        mesh = model.geom_dataid[n]
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        vertices = model.mesh_vert[first : first + count]
        solids.add(rock, vertices @ data.geom_xmat[n].reshape(3, 3).T + data.geom_xpos[n])
    return solids


def _bodies(model: Any, data: Any) -> dict[int, Body]:
    found = {}
    for n in range(1, model.nbody):
        rock = rock_of(model.body(n).name)
        if rock is not None:
            turn = matrix_from_quaternion(model.body_iquat[n])
            tensor = turn @ np.diag(model.body_inertia[n]) @ turn.T
            rotation = data.xmat[n].reshape(3, 3).copy()
            found[rock] = Body(float(model.body_mass[n]), tensor, data.xipos[n].copy(), rotation)
    return found


def _rest(sample: Sample, folder: Path) -> Array:
    """Where the balls come to rest in the exported world [m], without its rocks: none is near."""
    import mujoco

    radius = sample.balls.radius
    balls = "".join(
        _BALL.format(n=n, x=x, y=y, z=z, r=radius, i=0.4 * radius**2)
        for n, (x, y, z) in enumerate(sample.balls.start.tolist())
    )
    model = _load_sampled((), folder, balls)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=round(SETTLING / model.opt.timestep))
    names = [f"probe_ball_{n}" for n in range(len(sample.balls.rest))]
    return np.array([data.body(name).xpos[2] for name in names])


def _tracks(sample: Sample, folder: Path) -> Iterator[Track]:
    """The sites along the paths in scene.xml, and the tracks that move its mocap body."""
    scene = folder / "scene.xml"
    if not sample.world.trajectories or not scene.is_file():
        return
    root = ElementTree.parse(scene).getroot()
    places: dict[str, list[list[float]]] = {}
    for site in root.iter("site"):
        bead = _BEAD.fullmatch(site.get("name", ""))
        if bead:
            places.setdefault(bead[1], []).append([*map(float, site.get("pos", "").split())])
    for name, position in places.items():
        yield Track(name=name, time=None, position=np.array(position), quaternion=None)
    if any(body.get("mocap") == "true" for body in root.iter("body")):
        for path in sorted((folder / "paths").glob("*.csv")):
            yield track_of(path.stem, table_columns(path))


def opening(folder: Path, options: Any) -> Opening:
    """How the folder is opened."""
    del options
    return Opening(
        title="MuJoCo",
        commands=f"python -m mujoco.viewer --mjcf={quote(folder.name)}/scene.xml",
    )


CONSUMERS = (
    Consumer(name="MuJoCo", read=read_mjcf, quick=True),
    newton("world.xml", rock_error=_SCALE_ERROR, gravity_kept=False),
)
"""What reads these exports back."""
