import pytest

from terrain_forge.datasets import open_recording
from tests.helpers.recordings import write_recording


@pytest.fixture(scope="session")
def recording(tmp_path_factory):
    """Five stereo pairs, nine sweeps and 201 samples of an IMU over a level plane."""
    return open_recording(write_recording(tmp_path_factory.mktemp("recording")))
