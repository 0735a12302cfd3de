"""A recording of a world whose files were altered."""

from dataclasses import replace

import pytest

import terrain_forge as tf
from tests.helpers.driving_worlds import mix_up_shapes, recipe


def test_damaged_arrays_of_the_world_are_named(tmp_path):
    route = tf.Polyline(points_m=((-2.0, 0.0), (2.0, 0.0)))
    go = tf.PathSpec(name="go", route=route, speed_m_s=0.5)
    tf.build(replace(recipe(), paths=(go,), exports=()), tmp_path / "out")
    mix_up_shapes(tmp_path / "out")
    text = r"holds no readable .* \(a rock's shape is numbered "
    with pytest.raises(tf.OutputError, match=text):
        tf.record(tmp_path / "out", end=0.5)
    with pytest.raises(tf.OutputError, match=text):  # a compiled library ended the process
        tf.evaluate_maps(tmp_path / "out", ["map.txt"])
