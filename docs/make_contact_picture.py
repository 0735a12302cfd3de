"""Makes docs/images/rock_contact.jpg: rocks of Mars and the Moon without soil at them, and with.

`python docs/make_contact_picture.py`
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from terrain_forge.making import plan
from terrain_forge.model import World
from terrain_forge.pipeline import realise
from terrain_forge.recipe import recipe_from_json
from terrain_forge.scene import open_scene, pinhole_camera, take_picture

HERE = Path(__file__).parent
AWAY, ABOVE = 2.4, 1.2
VIEWS = {
    "mars": ({"azimuth_deg": 230, "elevation_deg": 28}, {"kind": "fractal"}, 1, 2.4),
    "moon": (
        {"azimuth_deg": 60, "elevation_deg": 18},
        {"kind": "fractal", "hurst": 0.76, "deviation_1m_m": 0.035},
        0,
        2.4,
    ),
}
"""The Sun, the ground, which of the largest rocks is seen, and towards where [rad]."""


def main() -> None:
    """Write the picture."""
    rows = []
    for body in VIEWS:
        bare, soiled = (_world(body, contact) for contact in ({"kind": "none"}, None))
        rows.append(np.concatenate([_view(bare, body), _view(soiled, body)], axis=1))
    Image.fromarray(np.concatenate(rows)).save(HERE / "images" / "rock_contact.jpg", quality=85)


def _world(body: str, contact: dict[str, str] | None) -> World:
    sun, layer, *_ = VIEWS[body]
    law = {"kind": "golombek", "k": 0.08}
    rocks = {"name": "rocks", "size_frequency": law, "diameter_m": [0.1, 1.5]}
    told = {
        "name": "contact", "seed": 5, "body": body, "dtm": {"kind": "flat", "size_m": [24, 24]},
        "terrain": {"spacing_m": 0.05, "layers": [layer]},
        "rocks": {"library": {"shapes": 24, "seed": 7}, "populations": [rocks], "contact": contact},
        "sun": sun, "exports": [],
    }  # fmt: skip
    return realise(plan(recipe_from_json(json.dumps(told))))


def _view(world: World, body: str) -> NDArray[np.uint8]:
    """One of the largest rocks that lie in the middle."""
    *_, number, yaw = VIEWS[body]
    rocks = world.field
    inner = np.flatnonzero(np.abs(rocks.position[:, :2]).max(axis=1) < 8.0)
    rock = rocks.position[inner[np.argsort(-rocks.diameter[inner])[number]]]
    at = rock[:2] - AWAY * np.array([np.cos(yaw), np.sin(yaw)])
    eye = np.array([*at, float(world.ground.height_at(*at)) + ABOVE])
    camera = pinhole_camera(
        position=eye, yaw=yaw, pitch=0.4, field_of_view=1.0, width=640, height=400
    )
    with open_scene(world) as scene:
        return take_picture(scene, camera)


if __name__ == "__main__":
    main()
