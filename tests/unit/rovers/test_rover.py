import json
import pickle

import numpy as np
import pytest
import trimesh

from terrain_forge.base import RecipeError, matrix_from_quaternion, quaternion_from_rpy
from terrain_forge.model import Grousers
from terrain_forge.recipe import recipe_from_json
from terrain_forge.rovers import built_in_rovers, find_rover
from terrain_forge.rovers.tread import corners
from tests.helpers import rovers
from tests.helpers.places import ROOT
from tests.helpers.rovers import morpheus, skid4


def dimension_table(spec):
    """The table of a rover's dimensions as docs/rovers.md has it."""
    lines = ["| dimension | default | meaning | source |", "|---|---|---|---|"]
    for name, one in spec.DESCRIPTION.dimensions.items():
        text = " × ".join(f"{v:g}" for v in np.ravel(one.default))
        source = one.source or spec.DESCRIPTION.source
        lines.append(f"| `{name}` | {text} | {one.meaning} | {source} |")
    return "\n".join(lines)


def meshed(shape, mass):
    """Mass, centre and inertia of a homogeneous solid, of its mesh."""
    mesh = {
        "box": lambda: trimesh.creation.box(shape.size),
        "cylinder": lambda: trimesh.creation.cylinder(*shape.size, sections=400),
    }[shape.kind]()
    placement = np.eye(4)
    placement[:3, :3] = matrix_from_quaternion(quaternion_from_rpy(shape.rpy))
    mesh.apply_transform(placement)
    mesh.density = mass / mesh.volume
    return mass, shape.position, mesh.moment_inertia


@pytest.mark.parametrize("name", ["morpheus", "skid4"])
def test_inertias_equal_those_of_the_meshed_solids(name):
    """Body, mast and tilted camera of base_link; a wheel's cylinder; a rocker's beam."""
    rover, sizes = find_rover(name), built_in_rovers()[name]().dimensions
    half = sizes.mast_mass_kg / 2
    for link in rover.links:
        masses = (sizes.body_mass_kg, half, half) if link.joint == "free" else (link.mass,)
        parts = [meshed(one, mass) for one, mass in zip(link.shapes, masses, strict=True)]
        mass, centre, inertia = rovers.total(parts)
        assert link.mass == pytest.approx(mass)
        np.testing.assert_allclose(link.centre_of_mass, centre, atol=1e-12)
        np.testing.assert_allclose(link.inertia, inertia, rtol=2e-4, atol=1e-9)


def test_masses_add_up_and_inertias_are_those_of_real_bodies():
    rover = morpheus()
    assert rover.mass == pytest.approx(50.0)
    for link in rover.links:
        np.testing.assert_array_equal(link.inertia, link.inertia.T)
        small, middle, large = np.linalg.eigvalsh(link.inertia)
        assert small > 0
        assert large <= small + middle + 1e-12


def test_parents_come_first_and_wheels_hang_where_they_say():
    rover = morpheus()
    names = [link.name for link in rover.links]
    assert names[0] == "base_link"
    assert len(set(names)) == len(names)
    for n, link in enumerate(rover.links[1:], 1):
        assert link.parent in names[:n]
    places = rovers.origins(rover)
    for wheel in rover.wheels:
        np.testing.assert_allclose(places[wheel.link], wheel.centre, atol=1e-15)
        assert wheel.centre[2] == wheel.radius


def test_it_has_six_motors_on_three_passive_rockers():
    links = morpheus().links
    assert sum(link.joint == "motor" for link in links) == 6
    rockers = {link.name: link for link in links if link.joint == "passive"}
    assert set(rockers) == {"rocker_left", "rocker_right", "rocker_rear"}
    carried = [link.parent for link in links if link.joint == "motor"]
    assert all(carried.count(name) == 2 for name in rockers)
    np.testing.assert_array_equal(rockers["rocker_rear"].axis, (1, 0, 0))
    np.testing.assert_array_equal(rockers["rocker_left"].axis, (0, 1, 0))


def test_each_wheel_carries_about_the_same_load():
    """The side rockers' pivots carry two wheels each, so equal loads need the centre at x = 0."""
    rover = morpheus()
    places = rovers.origins(rover)
    centre = sum(link.mass * (places[link.name] + link.centre_of_mass) for link in rover.links)
    centre /= rover.mass
    assert abs(centre[0]) < 0.02
    assert abs(centre[1]) < 1e-12
    assert np.arctan(0.5 * 0.76 / centre[2]) > rover.tilt_limit


@pytest.mark.parametrize("name", built_in_rovers())
def test_a_choice_survives_pickling(name):
    spec = built_in_rovers()[name]
    some, value = next(iter(spec.DESCRIPTION.dimensions.items()))
    mine = spec(step_limit_m=0.1, dimensions=type(spec().dimensions)(**{some: value.default}))
    assert pickle.loads(pickle.dumps(mine)) == mine
    assert pickle.loads(pickle.dumps(mine.dimensions)) == mine.dimensions


def test_dimensions_change_the_rover():
    wide = morpheus(dimensions={"track_m": 1.0, "wheel_mass_kg": 3.3})
    assert wide.width == pytest.approx(1.12)
    assert wide.mass == pytest.approx(56.0)
    assert skid4().mass == pytest.approx(48.0)


@pytest.mark.parametrize(
    ("change", "key", "message"),
    [
        ({"dimensions": {"wheel_radius_m": 0.0}}, "wheel_radius_m", "greater than 0"),
        ({"dimensions": {"body_m": [0.7, -0.4, 0.2]}}, "body_m", "greater than 0"),
        ({"dimensions": {"wheel_mass_kg": 0}}, "wheel_mass_kg", "greater than 0"),
        ({"dimensions": {"wheel_radius": 0.2}}, "wheel_radius", "unknown key 'wheel_radius'"),
        ({"model": "pretty"}, "model", "'detailed' or 'simplified'"),
        ({"grousers": {"count": 2}}, "count", "greater than or equal to 3"),
        ({"kind": "morfeus"}, "rover", "a mapping whose kind is morpheus, skid4 or file"),
        ({"kind": None}, "rover", "a mapping whose kind is morpheus, skid4 or file"),
    ],
)
def test_what_a_recipe_cannot_say_of_a_rover_is_refused(change, key, message):
    with pytest.raises(RecipeError, match=message) as caught:
        recipe_from_json(_recipe({"kind": "morpheus", **change}))
    assert key in str(caught.value)


def _recipe(rover):
    ground = {"dtm": {"kind": "flat", "size_m": [6, 4]}, "terrain": {"spacing_m": 0.1}}
    return json.dumps({"name": "yard", "body": "mars", **ground, "rover": rover})


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda: morpheus(dimensions={"wheel_radius_m": 0.3}),
         ("dimensions", "wheel_spacing_m")),
        (lambda: morpheus(dimensions={"wheel_radius_m": 1.7e308}),
         ("dimensions", "wheel_spacing_m")),
        (lambda: morpheus(dimensions={"mast_height_m": 0.3}),
         ("dimensions", "mast_height_m")),
        (lambda: skid4(dimensions={"track_m": 0.5}),
         ("dimensions", "track_m")),
        (lambda: skid4(grousers={"height_m": 0.1}), ("grousers", "height_m")),
        (lambda: skid4(grousers={"thickness_m": 0.12}), ("grousers", "thickness_m")),
    ],
)  # fmt: skip
def test_parts_that_do_not_fit_are_refused(make, key):
    with pytest.raises(RecipeError, match="must be") as caught:
        make()
    assert caught.value.key == ("rover", *key)


@pytest.mark.parametrize("make", [morpheus, skid4])
def test_the_detailed_model_weighs_and_drives_as_the_simplified_one(make, tmp_path):
    plain, nice = (make(model=model) for model in ("simplified", "detailed"))
    assert len(nice.links[0].shapes) > len(plain.links[0].shapes)
    for one, other in zip(plain.links, nice.links, strict=True):
        assert one.replace(shapes=()) == other.replace(shapes=())
        touched = [
            [shape.replace(visible=True) for shape in link.shapes if shape.collides]
            for link in (one, other)
        ]
        assert touched[0] == touched[1]
        assert any(shape.visible for shape in other.shapes)
    moves = [
        rovers.drive(
            rovers.on_the_flat(rover, tmp_path / rover_name),
            rover,
            speed=0.3,
            turn_rate=0.4,
            seconds=3.0,
        )
        for rover_name, rover in (("plain", plain), ("nice", nice))
    ]
    np.testing.assert_array_equal(moves[0][0], moves[1][0])
    assert moves[0][1] == moves[1][1] > 0.2


@pytest.mark.parametrize("collides", [False, True])
def test_grousers_reach_to_the_wheels_radius(collides):
    bars = {"count": 12, "height_m": 0.02, "thickness_m": 0.01, "collides": collides}
    rover = morpheus(grousers=bars)
    assert rover.wheels[0].grousers == Grousers(count=12, height=0.02, thickness=0.01)
    link = next(link for link in rover.links if link.name == rover.wheels[0].link)
    assert link.mass == morpheus().links[-1].mass
    bars = [shape for shape in link.shapes if shape.kind == "box"]
    assert len(bars) == 12
    for bar in bars:
        reach = np.hypot(*(corners(bar)[:, [0, 2]].T))
        assert reach.max() == pytest.approx(0.14, abs=1e-12)
        assert bar.collides == collides
    rolling = [shape.size[0] for shape in link.shapes if shape.collides and shape.kind != "box"]
    assert rolling == pytest.approx([0.12 if collides else 0.14])


def test_skid4_turns_on_the_spot(tmp_path):
    model = rovers.on_the_flat(skid4(), tmp_path)
    moved, yaw, *_ = rovers.drive(model, skid4(), speed=0.0, turn_rate=0.6, seconds=3.0)
    assert 0.5 < yaw < 1.8
    assert np.linalg.norm(moved[:2]) < 0.1


def test_the_page_tells_where_each_dimension_comes_from():
    page = (ROOT / "docs" / "rovers.md").read_text(encoding="utf-8")
    for spec in built_in_rovers().values():
        assert dimension_table(spec) in page


def test_stereo_cameras_stand_a_baseline_apart_and_look_down():
    left, right = morpheus().sensors[0].simple
    np.testing.assert_allclose(left.position - right.position, (0, 0.12, 0), atol=1e-15)
    forward = matrix_from_quaternion(quaternion_from_rpy(left.rpy))[:, 0]
    assert forward[2] == pytest.approx(-np.sin(np.radians(12)))


def test_rovers_are_found_by_name():
    assert find_rover("morpheus") == morpheus()
    with pytest.raises(RecipeError, match=r"unknown rover 'morfeus' \(did you mean 'morpheus'\?"):
        find_rover("morfeus")
    assert find_rover("skid4") == skid4()
    with pytest.raises(RecipeError, match=f"known: {', '.join(built_in_rovers())}; a rover"):
        find_rover("tank")
    with pytest.raises(RecipeError, match="unknown rover None, known: "):
        find_rover(None)
