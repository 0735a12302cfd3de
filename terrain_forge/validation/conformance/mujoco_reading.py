"""MJCF worlds in MuJoCo: rays onto the ground, the rocks' geoms, bodies, beads of the paths."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from terrain_forge.base import Array, SimulationError, load_model, matrix_from_quaternion
from terrain_forge.validation.conformance.consumer import Consumer
from terrain_forge.validation.conformance.probe import rock_of
from terrain_forge.validation.conformance.reading import (
    Bodies,
    Reading,
    Solids,
    SolidsOfRocks,
    Track,
    bodies,
)
from terrain_forge.validation.conformance.sample import SETTLING, Sample
from terrain_forge.validation.conformance.tracks import table_columns, track_of
from terrain_forge.validation.mujoco_agreement import ground_heights

_BEAD = re.compile(r"(.+)_\d+")


def read_mjcf(sample: Sample, folder: Path, scratch: Path) -> Reading:
    """An MJCF export as MuJoCo compiles it, all of it, with balls that come to rest in it.

    Raises:
        SimulationError: if MuJoCo cannot load it.
    """
    import mujoco

    del scratch
    model = _load(folder / "world.xml")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    hidden = [n for n in range(model.ngeom) if model.geom_contype[n] | model.geom_conaffinity[n]]
    reading = Reading(
        consumer=f"MuJoCo {mujoco.__version__}",
        heights=ground_heights(sample.world, model, data, sample.points),
        extent=_extent(model, data),
        touched=_solids(sample, model, data, set(hidden)),
        seen=_solids(sample, model, data, _shown(model)),
        gravity=float(model.opt.gravity[2]),
        bodies=_bodies(model, data),
        balls=_rest(sample, folder / "world.xml"),
        findings=_warnings(data),
    )
    return replace(reading, tracks=tuple(_tracks(sample, folder)))


def _load(path: Path) -> Any:
    try:
        return load_model(path)
    except ValueError as error:
        raise SimulationError(f"MuJoCo cannot load {path.name}: {error}") from None


def _warnings(data: Any) -> tuple[str, ...]:
    return tuple(f"warning {n}" for n in np.flatnonzero(data.warning.number).tolist())


def _extent(model: Any, data: Any) -> tuple[float, float, float, float] | None:
    """West, south, east and north edge of all height fields [m]."""
    import mujoco

    edges = [
        (*(data.geom_xpos[n, :2] - half), *(data.geom_xpos[n, :2] + half))
        for n in range(model.ngeom)
        if model.geom_type[n] == mujoco.mjtGeom.mjGEOM_HFIELD
        for half in [model.hfield_size[model.geom_dataid[n], :2]]
    ]
    if not edges:
        return None
    west, south, east, north = np.array(edges).T
    return float(west.min()), float(south.min()), float(east.max()), float(north.max())


def _shown(model: Any) -> set[int]:
    """The geoms that pictures show; the viewer hides groups from 3 on."""
    return set(np.flatnonzero(model.geom_group < 3).tolist())


def _solids(sample: Sample, model: Any, data: Any, geoms: set[int]) -> Solids:
    """The vertices of the rocks' mesh geoms, as far as they are among these."""
    import mujoco

    solids = SolidsOfRocks(sample.rocks)
    for n in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_MESH).tolist():
        rock = rock_of(model.geom(n).name)
        if n not in geoms or rock is None or not solids.wants(rock):
            continue
        mesh = model.geom_dataid[n]
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        vertices = model.mesh_vert[first : first + count]
        solids.add(rock, vertices @ data.geom_xmat[n].reshape(3, 3).T + data.geom_xpos[n])
    return solids.solids()


def _bodies(model: Any, data: Any) -> Bodies:
    rows = []
    for n in range(1, model.nbody):
        rock = rock_of(model.body(n).name)
        if rock is None:
            continue
        turn = matrix_from_quaternion(model.body_iquat[n])
        tensor = turn @ np.diag(model.body_inertia[n]) @ turn.T
        row = (
            rock, float(model.body_mass[n]), tensor, data.xipos[n].copy(),
            data.xmat[n].reshape(3, 3).copy(),
        )  # fmt: skip
        rows.append(row)
    return bodies(rows)


def _rest(sample: Sample, path: Path) -> Array:
    """Where the balls come to rest in the exported world [m]; dynamic rocks are left out."""
    import mujoco

    spec = mujoco.MjSpec.from_file(str(path))
    for body in list(spec.worldbody.bodies):
        if rock_of(body.name) is not None:
            spec.delete(body)
    moment = [0.4 * sample.balls.radius**2] * 3
    for n, start in enumerate(sample.balls.start):
        ball = spec.worldbody.add_body(name=f"probe_ball_{n}", pos=start)
        ball.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
        ball.mass, ball.inertia, ball.explicitinertial = 1.0, moment, True
        ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[sample.balls.radius, 0, 0])
    model = spec.compile()
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


MUJOCO = Consumer(name="MuJoCo", kinds=("mjcf",), read=read_mjcf)
"""MuJoCo's compiler, rays and solver."""
