"""A driven track as a path of the next world: the suspension's own motion instead of shake."""

from __future__ import annotations

import json

import numpy as np
import pytest

from terrain_forge.pipeline import build
from terrain_forge.recipe import recipe_from_json

TOUR = {"kind": "polyline", "points_m": [[-3, -1], [1, -1], [1, 1]]}
BEFORE = "before/validation/drive_tour.tum"


def recipe(route, **changes):
    drive = {"path": "tour", "film": False}
    return recipe_from_json(
        json.dumps(
            {
                "name": "yard",
                "seed": 5,
                "body": "moon",
                "dtm": {"kind": "flat", "size_m": [9, 6]},
                "terrain": {"spacing_m": 0.1, "layers": [{"kind": "fractal"}]},
                "paths": [{"name": "tour", "route": route, "speed_m_s": 0.4, "rate_hz": 10}],
                "exports": ["mjcf"],
                "validate": {"drive": drive, "points": 10},
                **changes,
            }
        )
    )


def poses(file):
    return np.loadtxt(file)


@pytest.mark.slow
def test_a_driven_track_is_a_path_with_its_true_poses(tmp_path):
    """On the Moon, end to end: what was driven is laid as it was, and can be driven again."""
    result = build(recipe(TOUR), tmp_path / "before")
    assert result.passed
    driven = poses(tmp_path / BEFORE)
    recorded = {"kind": "file", "file": BEFORE, "timing": "recorded", "attitude": "recorded"}
    result = build(recipe(recorded), tmp_path / "after", folder=tmp_path)
    assert result.passed
    laid = poses(tmp_path / "after" / "paths" / "tour.tum")
    assert abs(len(laid) - len(driven)) <= 1
    # The track is stretched in time to whole samples: by a tenth of a second at most.
    time = laid[:, 0] * driven[-1, 0] / laid[-1, 0]
    then = np.stack([np.interp(time, driven[:, 0], column) for column in driven.T[1:]], axis=-1)
    assert np.allclose(laid[:, 1:], then, atol=0.01)
    on_the_ground = recorded | {"attitude": "ground"}
    result = build(
        recipe(on_the_ground, exports=[], validate=None), tmp_path / "plane", folder=tmp_path
    )
    plane = poses(tmp_path / "plane" / "paths" / "tour.tum")
    assert np.abs(plane[:-2, 4:6] - laid[:-2, 4:6]).max() > 0.01
    again = json.loads((tmp_path / "after" / "validation" / "report.json").read_text())
    assert again["drive"]["reason"] == "arrived"
    assert again["drive"]["planned_time_s"] == pytest.approx(driven[-1, 0], abs=0.1)
