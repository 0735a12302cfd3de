import pytest

from tests import worlds


@pytest.fixture(scope="session")
def small_world():
    return worlds.world()
