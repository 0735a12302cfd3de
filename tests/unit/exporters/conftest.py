"""What tests of several formats read: the small world, exported once."""

import pytest
from pxr import Usd

from tests.helpers import sdf_files, usd_stages
from tests.helpers.ground_pictures import detailed
from tests.helpers.rovers import morpheus


@pytest.fixture(scope="session")
def sdf(small_world, tmp_path_factory):
    """The small world in four tiles, its larger rocks one by one."""
    return sdf_files.exported(small_world, tmp_path_factory.mktemp("gz") / "sdf", tile_cells=48)


@pytest.fixture(scope="session")
def usd(small_world, tmp_path_factory):
    """The small world with a rover, in four tiles."""
    world = detailed(small_world.replace(rover=morpheus()))
    return usd_stages.exported(world, tmp_path_factory.mktemp("usd") / "usd", tile_cells=48)


@pytest.fixture(scope="session")
def stage(usd):
    return Usd.Stage.Open(str(usd / "scene.usda"))
