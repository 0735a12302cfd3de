"""Small worlds to drive in, and the environment over them."""

from pathlib import Path

import numpy as np
import pytest

import terrain_forge as tf
from tests.helpers.recipes import flat

ID = "terrain_forge.learning:TerrainForge/Drive-v0"


def recipe() -> tf.Recipe:
    rocks = tf.PopulationSpec(
        name="rocks", size_frequency=tf.Golombek(k=0.05), diameter_m=(0.4, 0.9)
    )
    return flat(
        *((10.0, 8.0), 0.1),
        seed=5,
        horizon=tf.HorizonSpec(reach_m=0),
        terrain={"layers": (tf.Fractal(),)},
        rocks=tf.RocksSpec(library=tf.LibrarySpec(shapes=2), populations=(rocks,)),
        rover="skid4",
        exports={"mjcf": {"timestep_s": 0.005, "visual_min_m": 2, "texture_pixels": 16}},
        worlds=tf.WorldsSpec(difficulty=tf.DifficultySpec(level=(0.2, 0.5))),
    )


def make(made, **given):
    return pytest.importorskip("gymnasium").make(ID, worlds=made.directory, distance_m=3.0, **given)


def mix_up_shapes(world: Path) -> None:
    """Give the rocks of a built world shapes that its library has not, as another world's may."""
    file = world / "world" / "arrays.npz"
    with np.load(file) as archive:
        arrays = dict(archive)
    arrays["world/field/prototype"] += 50
    np.savez(file, **arrays)
