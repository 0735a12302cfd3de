"""What a change costs: a layer, a law, a route shape and a body are one module each.

The modules lie in a package of their own, installed with entry points; no file of ours knows them.
"""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
import rasterio

from tests.helpers.command_line import run
from tests.helpers.places import ROOT
from tests.helpers.plugins import fresh, install

LAYER = '''
from dataclasses import dataclass
from typing import Literal

import numpy as np
import terrain_forge as tf


@dataclass(frozen=True, kw_only=True)
class Ramp(tf.Layer):
    """Ground that rises to the east."""

    kind: Literal["ramp"] = "ramp"
    grade: tf.Positive
    """Rise over run."""

    def relief(self, *, site, window, elevation):
        east, _ = site.axes(window)
        return np.broadcast_to(self.grade * east, elevation.shape)
'''
LAW = '''
from dataclasses import dataclass
from typing import Literal

import numpy as np
import terrain_forge as tf


@dataclass(frozen=True, kw_only=True)
class Even(tf.SizeLaw):
    """Rocks of all diameters up to the largest are as many."""

    kind: Literal["even"] = "even"
    number_per_m2: tf.Positive
    """Rocks of all sizes on a square metre [1/m²]."""
    largest_m: tf.Positive
    """Largest diameter [m]."""

    @property
    def smallest_known(self):
        return 0.2

    def cumulative_number(self, diameter):
        part = 1.0 - np.asarray(diameter) / self.largest_m
        return self.number_per_m2 * np.clip(part, 0.0, 1.0)

    def cumulative_area(self, diameter):
        d = np.minimum(diameter, self.largest_m)
        cubes = self.largest_m**3 - d**3
        return 0.25 * np.pi * self.number_per_m2 * cubes / (3.0 * self.largest_m)

    def cover_variance(self, smallest, largest, area):
        fifths = (largest**5 - smallest**5) / (5.0 * self.largest_m)
        return (0.25 * np.pi) ** 2 * self.number_per_m2 * fifths / area

    def sample(self, hashes, smallest, largest):
        part = (hashes >> np.uint64(11)) * 2.0**-53
        return smallest + part * (largest - smallest)

    def report(self):
        return {"kind": self.kind, "number_per_m2": self.number_per_m2}
'''
SHAPE = '''
from dataclasses import dataclass
from typing import Literal

import numpy as np
import terrain_forge as tf


@dataclass(frozen=True, kw_only=True)
class Clover(tf.NamedShape):
    """A curve of four leaves."""

    kind: Literal["clover"] = "clover"

    def outline(self, key):
        def curve(t):
            return np.stack([np.cos(2 * t) * np.cos(t), np.cos(2 * t) * np.sin(t)], -1)

        def tangent(t):
            x = -2 * np.sin(2 * t) * np.cos(t) - np.cos(2 * t) * np.sin(t)
            y = -2 * np.sin(2 * t) * np.sin(t) + np.cos(2 * t) * np.cos(t)
            return np.stack([x, y], -1)

        return self.smooth(curve, tangent)
'''
BODY = '''
"""Callisto; but for gravity, radius and sunlight (NASA fact sheet) all is made up for a test."""

import terrain_forge as tf

CALLISTO = tf.Body(
    name="callisto",
    gravity=1.236,
    mean_radius=2410.3e3,
    solar_irradiance=50.26,
    sun_diameter=0.001787,
    airless=True,
    sky_rgb=(0.0, 0.0, 0.0),
    ground_rgb=(0.33, 0.31, 0.29),
    soils=(tf.Soil(name="dark_dust", rgb=(0.24, 0.22, 0.20)),),
    rock_rgb=(0.5, 0.5, 0.52),
    rock_density=1100.0,
    rock_decay=None,
    roughness=(0.7, 0.04),
    friction=tf.Frictions(regolith=tf.sheared(25.0, 30.0, 40.0, "assumption")),
    craters=tf.CraterConstants(
        largest_simple=4_000.0,
        depth=(0.15, 0.0),
        equilibrium="gault",
        bright_ejecta=True,
        chronology=tf.Chronology(burst=0.0, steady=1e-4),
        productions=(
            tf.ProductionFunction(
                kind="icy",
                coefficients=(-4.0, -3.0),
                range_km=(0.01, 10.0),
                chronology=tf.Chronology(burst=0.0, steady=1e-4),
                source="made up",
            ),
        ),
    ),
)
'''
PRODUCTION = '''
from dataclasses import dataclass
from typing import Literal

import numpy as np
import terrain_forge as tf


class Law:
    def __init__(self, number):
        self.whole = number

    def number(self, diameter):
        return self.whole * np.exp(-np.asarray(diameter))

    def slope(self, diameter):
        return np.asarray(diameter)


@dataclass(frozen=True, kw_only=True)
class Fading(tf.CraterProduction):
    """Craters whose number falls exponentially with diameter."""

    kind: Literal["fading"] = "fading"
    number_per_m2: tf.Positive
    """Craters of all sizes on a square metre [1/m²]."""

    def law(self, body):
        return Law(self.number_per_m2)
'''
PARTS = {
    "crater_productions": ("fading", PRODUCTION),
    "layers": ("ramp", LAYER),
    "size_laws": ("even", LAW),
    "route_shapes": ("clover", SHAPE),
    "bodies": ("callisto", BODY),
}
RECIPE = """
schema: 1
name: all-new
seed: 4
body: callisto
dtm: {kind: flat, size_m: [16, 12]}
terrain:
  spacing_m: 0.25
  appearance: {regolith: dark_dust, variation: 0}
  layers:
    - {kind: ramp, grade: 0.05}
    - {kind: craters, production: {kind: icy, age_ga: 4}, diameter_m: [1, 6]}
    - kind: craters
      name: seen
      production: {kind: fading, number_per_m2: 0.2, age_ga: 1}
      diameter_m: [1, 3]
rocks:
  library: {shapes: 2}
  populations:
    - name: stones
      size_frequency: {kind: even, number_per_m2: 0.5, largest_m: 0.6}
      dynamic_m: [0.2, 0.21]
paths:
  - {name: leaves, route: {kind: clover, length_m: 30}, speed_m_s: 0.5}
exports: [sdf, mjcf]
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The package as an installer leaves it: its modules and its entry points."""
    points = "".join(
        f"[terrain_forge.{group}]\n{name} = new_{name}\n" for group, (name, _) in PARTS.items()
    )
    modules = {f"new_{name}.py": text for name, text in PARTS.values()}
    return install(tmp_path_factory.mktemp("site"), "new_parts", points, modules)


@pytest.fixture(scope="module")
def built(installed, tmp_path_factory):
    """A world that needs all of the parts."""
    folder = tmp_path_factory.mktemp("built")
    (folder / "new.yaml").write_text(RECIPE)
    with fresh(installed):
        done = run("build", folder / "new.yaml", "-o", folder / "out")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "warning" not in done.stderr.lower()
    return folder / "out"


def rows(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_layer_is_one_module(built):
    with rasterio.open(built / "truth" / "surface.tif") as file:
        heights = file.read(1)
    assert np.median(heights[:, -1] - heights[:, 0]) == pytest.approx(0.05 * 16, abs=0.15)


def test_a_crater_production_is_one_module(built):
    craters = [row for row in rows(built / "truth" / "craters.csv") if row["layer"] == "seen"]
    sizes = np.array([float(row["diameter_m"]) for row in craters])
    assert len(sizes) > 3
    assert sizes.min() >= 1.0
    assert sizes.max() <= 3.0


def test_a_size_law_is_one_module(built):
    sizes = np.array([float(row["diameter_m"]) for row in rows(built / "truth" / "rocks.csv")])
    assert len(sizes) == pytest.approx(0.5 * 16 * 12 * 2 / 3, rel=0.5)
    assert sizes.min() >= 0.2
    assert sizes.max() <= 0.6
    assert np.median(sizes) == pytest.approx(0.4, abs=0.08)
    report = json.loads((built / "truth" / "size_frequency.json").read_text())
    assert '"kind": "even"' in json.dumps(report)


def test_a_route_shape_is_one_module(built):
    path = rows(built / "paths" / "leaves.csv")
    xy = np.array([[float(row["x_m"]), float(row["y_m"])] for row in path])
    length = np.linalg.norm(np.diff(xy, axis=0), axis=1).sum()
    assert length == pytest.approx(30.0, rel=0.01)
    assert np.hypot(*xy.T).min() < 0.1  # it passes through its centre


def test_a_body_is_one_module(built):
    from terrain_forge.model import World

    world = World.load(built)  # here, where Callisto is not installed
    assert world.site.body.name == "callisto"
    assert world.lighting.irradiance == 50.26
    assert np.allclose(world.field.mass, 1100.0 * world.field.volume)
    assert "-1.236" in (built / "sdf" / "world.sdf").read_text()
    assert "-1.236" in (built / "mjcf" / "world.xml").read_text()


def test_a_dtm_belongs_to_the_body_of_the_nearest_radius(installed, tmp_path):
    """Callisto's is within 2 % of Mercury's."""
    radii = {"callisto": 2410300, "mercury": 2439400}
    for name, radius in radii.items():
        path = tmp_path / f"{name}.tif"
        profile = {"driver": "GTiff", "width": 40, "height": 40, "count": 1, "dtype": "float32"}
        crs, affine = f"+proj=eqc +R={radius}", rasterio.transform.from_origin(5, 9, 1, 1)
        with rasterio.open(path, "w", crs=crs, transform=affine, **profile) as file:
            file.write(np.add.outer(np.arange(40.0), np.arange(40.0)).astype(np.float32), 1)
    with fresh(installed):
        for name in radii:
            done = run("check", tmp_path / f"{name}.tif")
            assert f"body         {name}" in done.stdout, done.stdout + done.stderr


def test_schema_and_messages_know_them(installed, tmp_path):
    (tmp_path / "new.yaml").write_text(RECIPE.replace("kind: icy", "kind: neukum"))
    with fresh(installed):
        import terrain_forge as tf

        schema = json.dumps(tf.json_schema())
        assert all(f'"{name}"' in schema for name, _ in PARTS.values())
        assert tf.BODIES["callisto"].gravity == 1.236
        done = run("check", tmp_path / "new.yaml")
    assert done.returncode == 2
    assert "neukum is no production function of Callisto, which has icy" in done.stderr


TWINS = """[terrain_forge.bodies]
none = a_module_that_nobody_has
moon = other_moon
weightless = weightless
[terrain_forge.size_laws]
golombek = other_law
[terrain_forge.route_shapes]
loop = other_loop
"""


def test_a_broken_or_doubled_one_is_skipped_with_a_warning(tmp_path, caplog):
    modules = {
        "other_moon.py": BODY.replace('"callisto"', '"moon"'),
        "weightless.py": BODY.replace("gravity=1.236", "gravity=0.0"),
        "other_law.py": LAW.replace('"even"', '"golombek"'),
        "other_loop.py": SHAPE.replace('"clover"', '"loop"'),
    }
    with fresh(install(tmp_path, "bad", TWINS, modules)):
        import terrain_forge as tf

        assert tf.Recipe.__name__ == "Recipe"
        assert tf.BODIES["moon"].gravity == 1.62
        assert "callisto" not in tf.BODIES
    for warning in (
        "body 'none' (a_module_that_nobody_has) is skipped: No module named",
        "body 'weightless' (weightless) is skipped: callisto has gravity that must be greater than",
        "body 'moon' of other_moon is skipped: terrain_forge.model.bodies.moon has that name",
        "size law 'golombek' of other_law is skipped: terrain_forge.rocks.laws.golombek has that",
        "route shape 'loop' of other_loop is skipped: terrain_forge.paths.shapes.loop has that",
    ):
        assert caplog.text.count(warning) == 1, caplog.text


def test_no_file_of_ours_names_them():
    ours = [*(ROOT / "terrain_forge").rglob("*.py"), *(ROOT / "exporters").rglob("*.py")]
    text = "\n".join(path.read_text("utf-8") for path in ours)
    assert '"neukum"' in text
    assert not any(f'"{name}"' in text for name, _ in PARTS.values())
