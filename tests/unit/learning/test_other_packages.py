"""What is ours in mjlab, Isaac Lab and Stable-Baselines3, as their packages have it.

Wants `pip install --no-deps mjlab isaaclab stable-baselines3 cloudpickle`. What is called of them
is plain NumPy, trimesh and Gymnasium; what else they import, PyTorch and Warp among it, is left out
or stands in as empty modules.
"""

from __future__ import annotations

import importlib
import sys
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType, SimpleNamespace
from unittest.mock import MagicMock

import gymnasium
import mujoco
import numpy as np
import pytest

from terrain_forge import learning
from terrain_forge.variation import worlds
from tests.helpers.driving_worlds import recipe

pytestmark = pytest.mark.consumer
SIZE = (6.0, 5.0)
OTHERS = {"mjlab", "isaaclab", "stable_baselines3", "torch", "warp"}
ABOVE = np.array([0.0, 0.0, 5.0])


@pytest.fixture
def package():
    """Makes packages importable without what their `__init__` does; all is undone afterwards."""
    before = {name: sys.modules.pop(name) for name in [*sys.modules] if root(name) in OTHERS}

    def bare(name: str, folder: Path, *parts: str) -> None:
        for part in ("", *parts):
            module = ModuleType(f"{name}.{part}".rstrip("."))
            module.__path__ = [str(folder / part.replace(".", "/"))]
            sys.modules[module.__name__] = module

    yield bare
    for name in [name for name in sys.modules if root(name) in OTHERS]:
        del sys.modules[name]
    sys.modules.update(before)


def root(name: str) -> str:
    """The package of a module."""
    return name.partition(".")[0]


def place_of(name: str, inside: str = "") -> Path:
    """Where a package lies, which is not imported."""
    found = find_spec(name)
    if found is None:
        pytest.skip(f"{name} is not installed")
    folder = Path(found.submodule_search_locations[0]) / inside
    if not folder.is_dir():
        pytest.skip(f"{name} has no {inside}")
    return folder


def stand_in(name: str, **content: object) -> ModuleType:
    """An empty module in place of one that is not there."""
    if name not in sys.modules and ("." in name or find_spec(name) is None):
        sys.modules[name] = ModuleType(name)
        vars(sys.modules[name]).update(content)
    return sys.modules.get(name) or importlib.import_module(name)


def test_mjlab_makes_a_grid_of_it(package):
    package("mjlab", place_of("mjlab"), "terrains", "utils")
    theirs = importlib.import_module("mjlab.terrains.terrain_generator")
    maker = learning.GroundMaker(recipe=recipe())

    @dataclass(kw_only=True)
    class Planetary(theirs.SubTerrainCfg):
        def function(self, difficulty, spec, rng):
            return maker.mjlab(difficulty, spec, rng, size=self.size)

    order = theirs.TerrainGeneratorCfg(
        seed=4, size=SIZE, num_rows=2, num_cols=2, border_width=1.0,
        sub_terrains={"planetary": Planetary()},
    )  # fmt: skip
    generator, spec = theirs.TerrainGenerator(order), mujoco.MjSpec()
    generator.compile(spec)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert model.nhfield == 4
    geom, down = np.zeros(1, np.int32), np.array([0.0, 0.0, -1.0])
    for row, column in np.ndindex(2, 2):
        origin = generator.terrain_origins[row, column]
        middle = ((row - 1) * 6.0 + 3.0, (column - 1) * 5.0 + 2.5)
        assert origin[:2] == pytest.approx(middle)
        depth = mujoco.mj_ray(model, data, origin + ABOVE, down, None, 1, -1, geom)
        assert 5.0 <= depth < 5.5
        assert model.geom_type[geom[0]] == mujoco.mjtGeom.mjGEOM_HFIELD


def isaac_lab(package):
    """Isaac Lab's generator and its configurations."""
    package("isaaclab", place_of("isaaclab", "source/isaaclab/isaaclab"), "terrains", "utils")
    flat = SimpleNamespace(unsqueeze=lambda _: None)  # of patches that nobody asks for
    tensor = type("Tensor", (), {})
    stand_in("torch", Tensor=tensor, float=np.float32, tensor=lambda *_, **__: flat)
    stand_in("warp", array=type("array", (), {}))
    stand_in("isaaclab.utils.warp", convert_to_warp_mesh=None, raycast_mesh=None)
    stand_in("isaaclab.utils.io", dump_yaml=lambda *_: None)
    utils = sys.modules["isaaclab.utils"]
    utils.configclass = importlib.import_module("isaaclab.utils.configclass").configclass
    return SimpleNamespace(
        **vars(importlib.import_module("isaaclab.terrains.terrain_generator_cfg"))
    )


def test_isaac_lab_makes_a_grid_of_it(package, tmp_path):
    theirs = isaac_lab(package)
    maker = learning.GroundMaker(recipe=recipe())

    def make(seed, maker=maker, use_cache=False):
        sub = theirs.SubTerrainBaseCfg(function=maker.isaac_lab, size=SIZE)
        order = theirs.TerrainGeneratorCfg(
            seed=seed, size=SIZE, num_rows=2, num_cols=2, border_width=1.0, curriculum=True,
            color_scheme="none", use_cache=use_cache, cache_dir=str(tmp_path),
            sub_terrains={"planetary": sub},
        )  # fmt: skip
        return theirs.TerrainGenerator(order)

    generator = make(4)
    low, high = generator.terrain_mesh.bounds
    assert low[:2] == pytest.approx((-7.0, -6.0))
    assert high[:2] == pytest.approx((7.0, 6.0))
    origins = generator.terrain_origins
    assert origins[..., 0] == pytest.approx(np.array([[-3, -3], [3, 3]]))
    assert origins[..., 1] == pytest.approx(np.array([[-2.5, 2.5], [-2.5, 2.5]]))
    assert len(np.unique(origins[..., 2])) == 4  # four worlds
    starts = origins.reshape(-1, 3) + ABOVE
    down = np.broadcast_to((0.0, 0.0, -1.0), starts.shape)
    hits, ray, _ = generator.terrain_mesh.ray.intersects_location(starts, down)
    highest = [hits[ray == n, 2].max() for n in range(4)]
    gap = origins[..., 2].ravel() - highest
    assert (gap > -0.05).all()  # rocks' meshes are as coarse as what collides
    assert gap.max() < 0.5
    assert np.array_equal(make(4).terrain_mesh.vertices, generator.terrain_mesh.vertices)
    assert not np.array_equal(make(5).terrain_origins, origins)
    # The cache knows a function by its name: that of another recipe has another one.
    makers = maker, learning.GroundMaker(recipe=replace(recipe(), seed=9)), maker
    grounds = [[make(4, one, cached).terrain_origins for one in makers] for cached in (False, True)]
    assert not np.array_equal(grounds[0][0], grounds[0][1])
    assert np.allclose(grounds[0], grounds[1])


def test_stable_baselines_steps_several(package, tmp_path):
    """The documented call, its checker, and what its algorithms read at the end of an episode."""
    package("stable_baselines3", place_of("stable_baselines3"), "common")
    pytest.importorskip("cloudpickle")
    if find_spec("torch") is None:
        for name in ("torch", "torch.nn", "torch.optim", "torch.utils", "torch.utils.tensorboard"):
            sys.modules[name] = MagicMock()
    checker = importlib.import_module("stable_baselines3.common.env_checker")
    util = importlib.import_module("stable_baselines3.common.env_util")
    made = worlds(recipe(), tmp_path / "many", count=2, workers=0).directory
    given = {"worlds": str(made), "distance_m": 3.0}
    name = "terrain_forge.learning:TerrainForge/Drive-v0"
    with pytest.warns(UserWarning, match="heights has an unconventional shape"):  # it is flattened
        checker.check_env(gymnasium.make(name, **given).unwrapped, skip_render_check=True)
    many = util.make_vec_env(name, n_envs=3, seed=4, env_kwargs=given)
    seen = many.reset()
    assert seen["heights"].shape == (3, *many.observation_space["heights"].shape)
    ends = list[dict]()
    for _ in range(55):  # standing still is stuck after five seconds
        _, _, done, told = many.step(np.zeros((3, 2), np.float32))
        ends += [one for one, over in zip(told, done, strict=True) if over]
    many.close()
    assert len(ends) == 3
    for end in ends:
        assert end["ended"] == "stuck"
        assert end["episode"]["r"] < -5.0
        assert end["terminal_observation"]["proprioception"].shape == (15,)
        assert not end["TimeLimit.truncated"]
