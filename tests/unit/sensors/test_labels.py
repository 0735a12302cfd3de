"""What the ground is called: craters by their depth now, before bedforms."""

import numpy as np

from terrain_forge.model import Table
from terrain_forge.recipe import recipe_json
from terrain_forge.sensors import Scenery, motion_of_path
from terrain_forge.sensors.labels import CLASSES, Labels
from terrain_forge.terrain import CraterLayer, Ripples
from terrain_forge.truth import craters_of
from tests.helpers import worlds
from tests.helpers.recipes import flat


def _world(*craters):
    """The world by hand on ripples, with craters: east, north, diameter, age, fresh ratio."""
    layers = (
        CraterLayer(file="craters.csv", diffusivity_m2_per_myr=0.4),
        Ripples(wavelength_m=1.0, height_m=0.02, slope_deg=(40, 50)),
    )
    recipe = flat(worlds.SIZE, worlds.SPACING, terrain={"layers": layers}, name="by-hand", seed=1)
    columns = ("x_m", "y_m", "diameter_m", "age_ga", "depth_to_diameter")
    table = Table(path="craters.csv", columns=columns, values=np.array(craters))
    world = worlds.world(rocks=0)
    site = world.site.replace(tables=(table,), recipe_json=recipe_json(recipe))
    return world.replace(site=site)


def test_craters_are_what_is_deep_enough_now_and_come_before_ripples():
    fresh, worn, gone, shallow = (-9, -5), (-3, -5), (-9, 3), (-3, 3)
    world = _world(
        (*fresh, 4.0, 0.0, 0.15), (*worn, 4.0, 0.001, 0.15), (*gone, 4.0, 0.004, 0.15),
        (*shallow, 4.0, 0.0, 0.03),
    )  # fmt: skip
    ((_, craters),) = craters_of(world)
    kept = dict(zip(map(tuple, craters.xy.tolist()), craters.depth / craters.diameter, strict=True))
    assert 0.04 < kept[worn] < 0.5 * 0.15  # has lost more than half, and is there
    assert 0.01 < kept[gone] < 0.04 > kept[shallow]
    with Scenery(world, motion_of_path(world.trajectories[0])) as scenery:
        labels = Labels(scenery)
    across = np.array([0.0, 1.8, 2.2])
    for place, name in ((fresh, "crater"), (worn, "crater"), (gone, "ripple"), (shallow, "crater")):
        node = (np.add(place, np.column_stack([across, 0 * across])) - world.ground.origin) / 0.25
        columns, rows = np.rint(node).astype(int).T
        told = [CLASSES[kind] for kind in labels.kinds[rows, columns]]
        assert told == [name, name, "ripple"]
