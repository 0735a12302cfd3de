"""Whatever a public function is given, it answers or raises an error of ours (docs/api.md)."""

from __future__ import annotations

import inspect
import pickle
from math import nan

import numpy as np
import pytest

import terrain_forge as tf

JUNK = (
    *(None, True, -1, 10**30, 0.5, nan, "x", "", b"x", (), (1, "a"), [[1.0], [1.0, 2.0]], {}),
    *({"a": 1}, {3}, object(), np.array(["x"]), np.zeros((2, 3)), iter("ab")),
)
"""What a caller may give by mistake, of several kinds."""
OURS = [getattr(tf, name) for name in tf.__all__]
FUNCTIONS = [one for one in OURS if inspect.isroutine(inspect.unwrap(one))]
LONG = ("realise", "write_world")
"""Those that work for a while before some junk is met."""


@pytest.fixture
def valid(small_world, tmp_path, monkeypatch):
    """An argument for each parameter, by its name: right, but soon at an end."""
    monkeypatch.chdir(tmp_path)
    world, path = small_world, small_world.trajectories[0]
    poses = tf.TimedPoses(time=path.time, position=path.position, quaternion=path.quaternion)
    return {
        **{"world": world, "site": world.site, "ground": world.ground, "library": world.library},
        **{"rocks": world.field, "rover": world.rover},
        **dict.fromkeys(("window", "around"), world.site.window),
        **dict.fromkeys(("recipe", "path"), "missing.yaml"),
        **dict.fromkeys(("out", "folder", "directory", "recording"), tmp_path / "missing"),
        **dict.fromkeys(("truth", "estimate"), poses),
        **dict.fromkeys(("name", "kind", "population", "stage", "source", "unit", "note"), "x"),
        **dict.fromkeys(("east", "north", "diameter", "figure", "limit", "smallest"), 1.0),
        **dict.fromkeys(("low_deg", "mean_deg", "high_deg", "time", "margin"), 1.0),
        **dict.fromkeys(("column", "row", "number", "root", "key", "word", "hashed", "seed"), 1),
        **dict.fromkeys(("columns", "rows", "most"), 2),
        **dict.fromkeys(("systems", "maps", "scores", "layers", "populations", "ids", "only"), ()),
        **{
            "centre": (0.0, 0.0),
            "size": (4.0, 4.0),
            "density": [2900.0],
            "points": np.zeros((1, 2)),
        },
        **{"spec": tf.LibrarySpec(shapes=1), "manifest": {}, "file": tmp_path, "axes": None},
        **{"spec": None, "scattered": None, "route": None, "field": None, "setting": None},
    }


def require_ours(call, given, named):
    """The call answers, or refuses with one line of ours."""
    try:
        answer = call(*given, **named)
        if inspect.isgenerator(answer):
            next(answer, None)
    except tf.TerrainForgeError as error:
        told = str(error)
        if not told or "\n" in told:
            raise ValueError(f"not one line: {told!r}") from error


def try_junk(call, valid):
    """Give a function junk for each parameter, the others as they should be."""
    parameters = inspect.signature(call).parameters.values()
    plain = [p for p in parameters if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)]
    needed = {p.name: valid[p.name] for p in plain if p.default is p.empty}
    for one in plain:
        for junk in JUNK:
            named = {**needed, one.name: junk}
            given = [named.pop(p.name) for p in plain if p.kind is p.POSITIONAL_ONLY]
            try:
                require_ours(call, given, named)
            except Exception as error:
                raise AssertionError(f"{call.__qualname__}: {one.name}={junk!r}") from error


@pytest.mark.parametrize(
    "function",
    [
        pytest.param(one, marks=pytest.mark.slow) if one.__name__ in LONG else one
        for one in FUNCTIONS
    ],
    ids=lambda one: one.__name__,
)
def test_functions_refuse_junk_in_a_line(function, valid):
    """No traceback of NumPy's or of ours, whatever a parameter is given."""
    try_junk(function, valid)


def methods(thing):
    """Its public methods that a user calls on it, without those of all records and errors."""
    inherited = {*dir(tf.Heightfield.__base__), *dir(tf.Spec), *dir(Exception)}
    names = [name for name in dir(thing) if not name.startswith("_") and name not in inherited]
    return [
        m
        for m in (inspect.getattr_static(type(thing), n, None) and getattr(thing, n) for n in names)
        if inspect.isroutine(m)
    ]


@pytest.mark.parametrize("part", ["world", "site", "ground", "window", "path", "field"])
def test_methods_of_records_refuse_junk_in_a_line(part, small_world, valid):
    world = small_world
    things = {
        **{"world": world, "site": world.site, "ground": world.ground, "field": world.field},
        **{"window": world.window, "path": world.trajectories[0]},
    }
    found = methods(things[part])
    for method in found:
        try_junk(method, valid)


@pytest.mark.parametrize(
    ("use", "words"),
    [
        (lambda _: tf.Golombek(k=-1.0).cumulative_number(0.2), "Golombek: k: must be greater"),
        (lambda _: tf.Golombek(k=0.05).cumulative_number("x"), "Golombek.cumulative_number: diam"),
        (lambda _: tf.Spiral(length_m="x").curve(("r",)), "Spiral: length_m: must be a valid num"),
        (lambda _: tf.make_library(tf.LibrarySpec(shapes=-1)), "LibrarySpec: shapes: must be gr"),
        (lambda _: tf.make_library(tf.LibrarySpec(shapes=0)), "0 shapes and no meshes"),
        (lambda p: tf.score_poses(p, p, tf.ScoreOptions(align="bogus")), "ScoreOptions: align: mu"),
        (lambda p: tf.score_poses(p, p, tf.ScoreOptions(association="bogus")), "association: mu"),
        (lambda _: tf.plan({"schema": 1}), "plan: recipe must be a Recipe or "),
        (lambda _: tf.Golombek(k=0.05).cumulative_number(0), "diameter must be above 0, found 0"),
        (lambda _: tf.Golombek(k=0.05).cover_variance(0.0, 1.0, 0.0), "area must be a number at l"),
        (lambda _: tf.sheared(50, 40, 30, "x"), "sheared: 50, 40, 30°: must ascend"),
        (
            lambda _: tf.Chronology(burst=1e-14, steady=1e-3).number("x"),
            "number: age must be numbers",
        ),
        (lambda _: tf.Chronology(burst=1e-14, steady=1e-3).number(-1), "age must be 0 to 100"),
    ],
)
def test_specs_made_in_python_are_held_to_their_limits(use, words, valid):
    with pytest.raises(tf.TerrainForgeError, match=words):
        use(valid["truth"])


def test_a_spec_that_was_checked_is_as_it_was():
    law = tf.Golombek(k=0.05)
    before = dict(vars(law))
    law.cumulative_number(0.2)
    assert (vars(law), law) == (before, pickle.loads(pickle.dumps(law)))


def test_a_shape_has_the_levels_that_it_has(small_world):
    for level in (None, 99):
        with pytest.raises(tf.DataError, match="level"):
            small_world.library.prototypes[0].drawn(level)


def test_a_ground_that_its_window_does_not_fit_is_refused(small_world):
    cut = small_world.ground.cut(column=0, row=0, columns=3, rows=2)
    told = r"World: ground has nodes of shape \(3, 4\), its window \("
    with pytest.raises(tf.DataError, match=told) as error:
        small_world.replace(ground=cut)
    assert not type(error.value).__name__.startswith("_")


def test_a_field_that_no_recording_has_is_refused(small_world, tmp_path):
    with pytest.raises(tf.RecipeError, match=r"record: unknown 'pth' \(did you mean 'path'\?\)"):
        tf.record(small_world, tmp_path / "out", pth="x")


def test_a_part_that_is_not_in_the_grid_is_refused(small_world):
    with pytest.raises(tf.DataError, match="the grid has columns 0 to 96"):
        small_world.ground.cut(column=96, row=0, columns=1, rows=1)
