"""A sensor that is made in Python is the one of a recipe."""

import pytest
from pydantic import TypeAdapter

import terrain_forge as tf
from terrain_forge.base import RecipeError
from terrain_forge.rovers import AnySensor

KINDS = tf.CameraSensor, tf.StereoSensor, tf.LidarSensor, tf.ImuSensor


@pytest.mark.parametrize(
    ("kind", "preset"), [(kind, name) for kind in KINDS for name in ("", *kind.PRESETS)]
)
def test_a_preset_fills_in_what_is_not_given(kind, preset):
    told = {"kind": kind.kind, "name": "a", "preset": preset}
    made = kind(name="a", preset=preset)
    assert made == TypeAdapter(AnySensor).validate_python(told)
    assert kind(name="a", preset=preset, rate_hz=1.5).rate_hz == 1.5
    assert made.replace(name="b") == kind(name="b", preset=preset)


def test_an_unknown_preset_is_refused_where_it_is_given():
    with pytest.raises(RecipeError, match=r"unknown preset 'vlp16' \(did you mean 'vlp-16'\?\)"):
        tf.LidarSensor(name="a", preset="vlp16")
