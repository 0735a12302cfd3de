"""Worlds, sites, recipes and results as a person meets them in Python."""

import base64
import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

import terrain_forge as tf
from terrain_forge.building import BuildResult
from terrain_forge.model import write_plot
from terrain_forge.recipe import RecipeFile
from tests.helpers.recipes import flat


def picture(html):
    """The picture in a value's HTML."""
    data = re.search(r'src="data:image/png;base64,([^"]+)"', html)[1]
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB"), float)


def test_plot_shows_ground_rocks_and_paths_in_their_places(small_world):
    figure = Figure()
    axes = small_world.plot(figure.add_subplot())
    west, south, east, north = small_world.ground.bounds
    assert (axes.get_xlim(), axes.get_ylim()) == ((west, east), (south, north))
    (circles,) = axes.collections
    assert np.allclose(circles.get_offsets(), small_world.field.position[:, :2])
    assert np.allclose(circles.get_widths(), small_world.field.diameter)
    path = axes.lines[0]
    assert np.allclose(path.get_xydata(), small_world.trajectories[0].position[:, :2])
    # The hill at (6, -3) is lit from the north-west: bright there, dark on its other side.
    (image,) = axes.images
    shade = np.asarray(image.get_array()).mean(axis=-1)
    row, column = (np.array([-3.0, 6.0]) - [south, west]) / small_world.ground.spacing
    lit, dark = (shade[int(row + side * 5), int(column - side * 5)] for side in (1, -1))
    assert lit > 1.2 * dark


def test_names_are_no_formulas_and_none_is_hidden(small_world, tmp_path):
    paths = [replace(small_world.trajectories[0], name=name) for name in ("$^_$", "_hidden")]
    world = small_world.replace(
        site=replace(small_world.site, name="$^_$"), trajectories=tuple(paths)
    )
    figure = Figure()
    axes = world.plot(figure.add_subplot())
    assert axes.get_title().startswith("$^_$: 40 rocks on ")
    shown = [text.get_text().strip() for text in axes.get_legend().get_texts()]
    assert shown == ["$^_$", "_hidden"]
    write_plot(world, tmp_path / "plot.png", note="a note", software="a test")


def test_values_are_short_in_text_and_pictures_in_notebooks(small_world, tmp_path):
    recipe = small_world.site.recipe
    result = BuildResult(directory=tmp_path, world=small_world, passed=True, exports=())
    file = RecipeFile(path=Path("some.yaml"), recipe=recipe, lines={("seed",): 3})
    for value in (small_world, small_world.site, recipe, file, result):
        assert len(repr(value)) < 250
        assert "by-hand" in repr(value) or value is result
    assert "rocks: 40, paths: arc" in repr(small_world)
    assert "elevation=float32[65, 97]" in repr(small_world.ground)
    assert picture(small_world._repr_html_()).std() > 20.0
    shown = recipe, file, small_world.site
    assert all(picture(value._repr_html_()).std() > 5.0 for value in shown)
    assert "<img" not in result._repr_html_()
    Image.new("RGB", (8, 4), (200, 10, 10)).save(tmp_path / "preview.png")
    assert picture(result._repr_html_()).shape == (4, 8, 3)


def test_progress_is_shown_where_it_is_wished(capsys):
    site = tf.plan(flat((3.0, 2.0), 0.25, body="moon", shapes=1))
    tf.realise(site)
    assert capsys.readouterr().err == ""
    tf.realise(site, progress=True)
    told = capsys.readouterr().err.splitlines()
    stages = []
    tf.realise(site, progress=lambda stage, share: stages.append(stage))
    assert [line.split(" ", 2)[2] for line in told] == stages
    assert stages == ["rock library", "ground", "rocks", "paths"]
