"""What of a recording is refused before there is a world."""

import pytest

from terrain_forge.base import RecipeError
from terrain_forge.pipeline import check
from terrain_forge.recipe import load_recipe

RECIPE = """schema: 1
name: early
body: moon
dtm: {kind: flat, size_m: [12, 8]}
terrain: {spacing_m: 0.1}
rover: skid4
paths:
- {name: ahead, route: {kind: polyline, points_m: [[0, 0], [2, 0]]}, speed_m_s: 0.5, rate_hz: 10}
sensors:
- {name: eye, kind: camera, rate_hz: RATE, position_m: [0.4, 0, 1]}
- {name: imu, kind: imu}
dataset: {path: ahead, still_s: 0, ramp_s: 0}
exports: []
"""


@pytest.fixture
def told(tmp_path):
    def of(rate):
        file = tmp_path / "early.yaml"
        file.write_text(RECIPE.replace("RATE", str(rate)))
        return "\n".join(check(load_recipe(file).recipe, folder=tmp_path))

    return of


def test_a_path_shorter_than_a_frame_is_refused(told):
    with pytest.raises(RecipeError, match=r"'ahead' lasts 4 s, sensor 'eye' takes 5 s"):
        told(0.2)


def test_a_path_longer_than_a_frame_has_a_cost(told):
    assert "4 s, 2 measurements" in told(0.3)
