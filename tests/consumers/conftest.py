"""Pythons of other programs."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def python() -> Path:
    """The Python that has systems of SLAM and readers of datasets."""
    named = os.environ.get("TERRAIN_FORGE_SLAM_PYTHON", "")
    if not Path(named).is_file():
        pytest.skip("TERRAIN_FORGE_SLAM_PYTHON names no Python")
    return Path(named)
