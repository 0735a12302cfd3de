"""Worlds that tests of learning share."""

import pytest

from terrain_forge.variation import worlds
from tests.helpers.driving_worlds import recipe


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    return worlds(recipe(), tmp_path_factory.mktemp("learning") / "out", count=2, workers=0)
