"""USD stages in OpenUSD: composed as any application composes them, and its own validators."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from shlex import quote
from typing import Any

import numpy as np

from terrain_forge.base import Array, matrix_from_quaternion
from terrain_forge.model import Mesh, Opening
from terrain_forge.paths import Deviation, angles_between, times_between
from terrain_forge.validation import (
    BACKDROP,
    Body,
    Consumer,
    Reading,
    Sample,
    SolidsOfRocks,
    Track,
    highest_on,
    is_ground,
    newton,
    rock_of,
    split_merged,
)
from terrain_forge.writers import identifier

_QUICK_TIMES = 2000
"""At how many times of a replay a quick sample looks."""


def read_usd(sample: Sample, folder: Path, options: Any, scratch: Path) -> Reading:
    """A USD export as OpenUSD composes it; physics is read, not run."""
    from pxr import Usd

    del scratch
    consumer = f"OpenUSD {'.'.join(map(str, Usd.GetVersion()[1:]))}"
    stage, scene = Usd.Stage.Open(str(folder / "world.usda")), folder / "scene.usda"
    if sample.quick:
        heights = highest_on(_ground(stage), sample.points)
        return Reading(consumer=consumer, heights=heights, replays=tuple(_replays(sample, scene)))
    touched, seen = _rocks(sample, stage)
    replay = Usd.Stage.Open(str(scene)) if scene.is_file() else None
    findings = [*_findings(stage), *(_findings(replay) if replay else ())]
    return Reading(
        consumer=consumer,
        ground=tuple(_ground(stage)),
        touched=touched,
        seen=seen,
        rock_error=options.outline_error,
        close=options.close_within_m > 0.0,
        gravity=_gravity(stage),
        bodies=_bodies(stage),
        tracks=tuple(_tracks(replay)) if replay else None,
        findings=tuple(dict.fromkeys(findings)),
        reasons={"balls": "OpenUSD has no physics engine"},
    )


def _ground(stage: Any) -> Iterator[Mesh]:
    """The ground as it is touched."""
    from pxr import UsdGeom, UsdPhysics

    places = UsdGeom.XformCache()
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Mesh) and _is_ground(prim) and prim.HasAPI(UsdPhysics.CollisionAPI):
            yield _mesh(prim, places)


def _is_ground(prim: Any) -> bool:
    return any(map(is_ground, str(prim.GetPath()).split("/")))


def _rocks(sample: Sample, stage: Any) -> tuple[SolidsOfRocks, SolidsOfRocks]:
    """The rocks as they are touched and seen."""
    from pxr import Usd, UsdGeom, UsdPhysics

    places = UsdGeom.XformCache()
    touched, seen = SolidsOfRocks(sample.rocks), SolidsOfRocks(sample.rocks)
    prims = iter(Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()))
    for prim in prims:
        rock = rock_of(str(prim.GetPath()))
        if rock is not None and not touched.wants(rock):
            prims.PruneChildren()
        elif prim.GetName() in BACKDROP:
            prims.PruneChildren()
        elif prim.IsA(UsdGeom.PointInstancer):
            _add_instances(seen, UsdGeom.PointInstancer(prim), places)
            prims.PruneChildren()
        elif prim.IsA(UsdGeom.Mesh) and not _is_ground(prim):
            mesh = _mesh(prim, places)
            collides = prim.HasAPI(UsdPhysics.CollisionAPI)
            shown = UsdGeom.Imageable(prim).ComputePurpose() != UsdGeom.Tokens.guide
            for solids, counts in ((touched, collides), (seen, shown)):
                if counts and rock is not None:
                    solids.add(rock, mesh.vertices)
                elif counts:
                    solids.add_merged(*split_merged(sample, mesh))
    return touched, seen


def _mesh(prim: Any, places: Any) -> Mesh:
    """A mesh prim's triangles in the world frame."""
    from pxr import UsdGeom

    corners = np.array(UsdGeom.Mesh(prim).GetFaceVertexIndicesAttr().Get(), dtype=np.int32)
    vertices = _moved(_points(prim), np.array(places.GetLocalToWorldTransform(prim)))
    return Mesh(vertices=vertices, faces=corners.reshape(-1, 3))


def _points(prim: Any) -> Array:
    from pxr import UsdGeom

    return np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get(), dtype=np.float64)


def _moved(points: Array, matrix: Array) -> Array:
    """Points by a matrix of USD, which is to the right of its rows."""
    return points @ matrix[:3, :3] + matrix[3, :3]


def _add_instances(solids: SolidsOfRocks, instancer: Any, places: Any) -> None:
    """Add those instances that are looked at; their ids are the rocks'."""
    from pxr import Usd, UsdGeom

    time = Usd.TimeCode.Default()
    ids = np.array(instancer.GetIdsAttr().Get())
    wanted = [n for n, rock in enumerate(ids.tolist()) if solids.wants(rock)]
    if not wanted:
        return
    matrices = np.array(instancer.ComputeInstanceTransformsAtTime(time, time))
    outer = np.array(places.GetLocalToWorldTransform(instancer.GetPrim()))
    stage, targets = instancer.GetPrim().GetStage(), instancer.GetPrototypesRel().GetTargets()
    kinds = instancer.GetProtoIndicesAttr().Get()

    @cache
    def vertices(kind: int) -> Array:
        # A prototype's own place is part of an instance's transform already.
        root = stage.GetPrimAtPath(targets[kind])
        return np.concatenate([
            _moved(_points(prim), np.array(places.ComputeRelativeTransform(prim, root)[0]))
            for prim in Usd.PrimRange(root, Usd.TraverseInstanceProxies())
            if prim.IsA(UsdGeom.Mesh)
        ])  # fmt: skip

    for n in wanted:
        solids.add(int(ids[n]), _moved(vertices(int(kinds[n])), matrices[n] @ outer))


def _gravity(stage: Any) -> float | None:
    """Gravity along z [m/s²] of the physics scene."""
    from pxr import UsdPhysics

    for prim in stage.Traverse():
        if prim.IsA(UsdPhysics.Scene):
            scene = UsdPhysics.Scene(prim)
            down = float(scene.GetGravityDirectionAttr().Get()[2])
            return down * float(scene.GetGravityMagnitudeAttr().Get())
    return None


def _bodies(stage: Any) -> dict[int, Body]:
    """The rigid bodies with what they say of their masses."""
    from pxr import UsdGeom, UsdPhysics

    places, found = UsdGeom.XformCache(), {}
    for prim in stage.Traverse():
        rock = rock_of(str(prim.GetPath()))
        if rock is None or not prim.HasAPI(UsdPhysics.RigidBodyAPI):
            continue
        said = UsdPhysics.MassAPI(prim)
        axes = said.GetPrincipalAxesAttr().Get()
        turn = matrix_from_quaternion(np.array([axes.GetReal(), *axes.GetImaginary()]))
        tensor = turn @ np.diag(said.GetDiagonalInertiaAttr().Get()) @ turn.T
        matrix = np.array(places.GetLocalToWorldTransform(prim))
        centre = _moved(np.array(said.GetCenterOfMassAttr().Get()), matrix)
        found[rock] = Body(float(said.GetMassAttr().Get()), tensor, centre, matrix[:3, :3].T)
    return found


def _tracks(stage: Any) -> Iterator[Track]:
    """The prims that move, at their own time samples."""
    from pxr import UsdGeom

    rate = stage.GetTimeCodesPerSecond()
    for prim in stage.Traverse():
        if not prim.IsA(UsdGeom.Xform):
            continue
        codes = UsdGeom.Xformable(prim).GetTimeSamples()
        if len(codes) < 2:
            continue
        matrices = [UsdGeom.XformCache(code).GetLocalToWorldTransform(prim) for code in codes]
        turns = [matrix.ExtractRotationQuat() for matrix in matrices]
        yield Track(
            name=prim.GetName(),
            time=np.array(codes) / rate,
            position=np.array([matrix.ExtractTranslation() for matrix in matrices]),
            quaternion=np.array([[turn.GetReal(), *turn.GetImaginary()] for turn in turns]),
        )


def _replays(sample: Sample, scene: Path) -> Iterator[Deviation | None]:
    """How far replays leave the paths between their samples, as usd-core interpolates them."""
    from pxr import Usd, Vt

    if not sample.world.trajectories:
        return
    stage = Usd.Stage.Open(str(scene), Usd.Stage.LoadNone)
    rate = float(stage.GetTimeCodesPerSecond())
    for trajectory in sample.world.trajectories:
        prim = stage.GetPrimAtPath(f"/World/Paths/{identifier(trajectory.name)}")
        if not prim:
            yield None
            continue
        translate, orient = (prim.GetAttribute(f"xformOp:{n}") for n in ("translate", "orient"))
        asked = times_between(np.array(translate.GetTimeSamples()) / rate)
        if sample.quick and len(asked) > _QUICK_TIMES:
            asked = asked[np.linspace(0, len(asked) - 1, _QUICK_TIMES).astype(np.int64)]
        codes = (asked * rate).tolist()
        # USD's own arrays become NumPy's twenty times as fast as lists of its values do.
        places = np.array(Vt.Vec3dArray([translate.Get(code) for code in codes]))
        turns = np.array(Vt.QuatdArray([orient.Get(code) for code in codes]))
        quaternion = np.roll(turns, 1, axis=1)  # its memory holds x, y, z, w
        wanted = trajectory.at(asked)
        yield Deviation(
            position=float(np.linalg.norm(places - wanted.position, axis=1).max()),
            angle=float(angles_between(quaternion, wanted.quaternion).max()),
        )


def _findings(stage: Any) -> Iterator[str]:
    """What is not as the world's conventions are, and what OpenUSD's validators find."""
    from pxr import UsdGeom, UsdPhysics, UsdValidation

    if UsdGeom.GetStageUpAxis(stage) != UsdGeom.Tokens.z:
        yield "z is not up"
    if UsdGeom.GetStageMetersPerUnit(stage) != 1.0:
        yield "lengths are not in metres"
    if UsdPhysics.GetStageKilogramsPerUnit(stage) != 1.0:
        yield "masses are not in kilograms"
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    for error in UsdValidation.ValidationContext(validators).Validate(stage):
        yield f"{error.GetIdentifier()}: {error.GetMessage()}"


def opening(folder: Path, options: Any) -> Opening:
    """How the folder is opened."""
    del options
    others = "or File › Open in Isaac Sim, Omniverse, Blender"
    return Opening(title="USD", commands=f"usdview {quote(folder.name)}/scene.usda   # {others}")


CONSUMERS = (Consumer(name="OpenUSD", read=read_usd, quick=True), newton("world.usda"))
"""What reads these exports back."""
