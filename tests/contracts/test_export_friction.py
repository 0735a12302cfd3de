"""Friction of ground and rocks: the same in every format that says it."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from terrain_forge.model import BODIES, MARS, exporter
from terrain_forge.rocks.embedding.dynamic import SLIDING

MU = "{http://drake.mit.edu}mu_"


def sdf(folder):
    paths = [folder / f"models/by-hand_{part}/model.sdf" for part in ("ground", "rocks")]
    found = [
        {float(e.text) for tag in ("mu", "mu2") for e in ET.parse(path).getroot().iter(tag)}
        for path in paths
    ]
    world = ET.parse(folder / "world.sdf").getroot()
    return *found, {float(e.text) for e in world.iter("mu")}


def drake(folder):
    found = [set(), set(), set()]
    for model in ET.parse(folder / "world.sdf").getroot().iter("model"):
        kind = {"ground": 0, "rocks": 1, "rock": 2}[model.get("name").partition("_")[0]]
        found[kind] |= {float(e.text) for e in model.iter() if e.tag.startswith(MU)}
    return found


def usd(folder):
    from pxr import Usd, UsdPhysics, UsdShade

    stage = Usd.Stage.Open(str(folder / "world.usda"))
    found = [set(), set(), set()]
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        if not prim.HasAPI(UsdPhysics.CollisionAPI):
            continue
        look = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("physics")[0]
        physics = UsdPhysics.MaterialAPI(look.GetPrim())
        path = str(prim.GetPath())
        kind = 0 if "/Ground/" in path else 2 if "/dynamic_" in path else 1
        for value in (physics.GetStaticFrictionAttr(), physics.GetDynamicFrictionAttr()):
            found[kind].add(round(value.Get(), 6))
    return found


def mjcf(folder):
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(folder / "world.xml"))
    found = [set(), set(), set()]
    for number in range(model.ngeom):
        if model.geom_conaffinity[number]:
            kind = 0 if model.geom_type[number] == mujoco.mjtGeom.mjGEOM_HFIELD else 1
            kind = 2 if model.body_mass[model.geom_bodyid[number]] else kind
            found[kind].add(round(float(model.geom_friction[number, 0]), 6))
    return found


READERS = {"sdf": sdf, "drake": drake, "usd": usd, "mjcf": mjcf}


def frictions(world, folder, kind, **options):
    """Coefficients of the ground, the static rocks and the dynamic ones."""
    module, target = exporter(kind), folder / "-".join([kind, *map(str, options.values())])
    target.mkdir()
    module.export(world, target, options=module.Options(**options))
    return tuple(READERS[kind](target))


@pytest.mark.parametrize("kind", READERS)
@pytest.mark.parametrize("body", BODIES.values(), ids=list(BODIES))
def test_each_surface_has_the_friction_of_its_body(small_world, tmp_path, kind, body):
    dynamic = np.arange(len(small_world.field)) % 3 == 0
    world = small_world.replace(
        site=small_world.site.replace(body=body), field=small_world.field.replace(dynamic=dynamic)
    )
    wanted = {
        name: {getattr(body.friction, name).coefficient} for name in ("regolith", "bedrock", "rock")
    }
    own = {SLIDING}
    assert frictions(world, tmp_path, kind) == (wanted["regolith"], wanted["rock"], own)
    hard = frictions(world, tmp_path, kind, surface="bedrock")
    assert hard == (wanted["bedrock"], wanted["rock"], own)
    assert frictions(world, tmp_path, kind, friction=0.31) == ({0.31}, {0.31}, own)


def test_a_height_map_has_it_too(small_world, tmp_path):
    ground, rocks, _ = frictions(small_world, tmp_path, "sdf", ground="heightmap")
    assert ground == {MARS.friction.regolith.coefficient}
    assert rocks == {MARS.friction.rock.coefficient}
