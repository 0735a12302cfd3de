import shutil

import pytest

from tests.helpers.recordings import write_recording


@pytest.fixture(scope="session")
def _recorded(tmp_path_factory):
    return write_recording(tmp_path_factory.mktemp("bench") / "dataset")


@pytest.fixture
def dataset(_recorded, tmp_path):
    return shutil.copytree(_recorded, tmp_path / "dataset")
