"""What USD files of an export say."""

import warnings
from functools import partial

import numpy as np
from pxr import UsdGeom, UsdPhysics, UsdSemantics, UsdValidation

from tests.helpers import exports

exported = partial(exports.exported, "usd")


def findings(stage):
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 20
    errors = UsdValidation.ValidationContext(validators).Validate(stage)
    return [(error.GetName(), error.GetMessage()) for error in errors]


def world_mesh(prim):
    """Vertices in the world frame and faces of a mesh."""
    mesh = UsdGeom.Mesh(prim)
    matrix = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(prim))
    points = np.array(mesh.GetPointsAttr().Get(), float) @ matrix[:3, :3] + matrix[3, :3]
    assert set(mesh.GetFaceVertexCountsAttr().Get()) == {3}
    return points, np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)


def labelled(stage, name):
    for prim in stage.Traverse():
        if prim.HasAPI(UsdSemantics.LabelsAPI):
            labels = UsdSemantics.LabelsAPI(prim, "class").GetLabelsAttr().Get()
            if list(labels) == [name]:
                yield prim


def frictions(stage):
    """The frictions of each collider by its path, as OpenUSD's own reader of physics finds them."""
    with warnings.catch_warnings(action="ignore", category=DeprecationWarning):
        read = UsdPhysics.LoadUsdPhysicsFromRange(stage, [stage.GetPseudoRoot().GetPath()])
    paths, materials = read[UsdPhysics.ObjectType.RigidBodyMaterial]
    known = dict(zip(paths, (material.dynamicFriction for material in materials), strict=True))
    kinds = (kind for kind in read if str(kind).endswith("Shape"))
    shapes = [pair for kind in kinds for pair in zip(*read[kind], strict=True)]
    return {str(path): [known[name] for name in shape.materials] for path, shape in shapes}
