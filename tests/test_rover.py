import numpy as np
import pytest

from terrain_forge.errors import RecipeError
from terrain_forge.frames import matrix_from_quaternion, quaternion_from_rpy
from terrain_forge.rovers.catalogue import find_rover, rover_names
from terrain_forge.rovers.description import Shape
from terrain_forge.rovers.inertia import combine, solid_inertia
from terrain_forge.rovers.morpheus import MorpheusDimensions, morpheus


def shape(kind, size, position=(0, 0, 0), rpy=(0, 0, 0)):
    return Shape(kind=kind, size=size, position=position, rpy=rpy, collides=True, rgb=(1, 1, 1))


def origins(rover):
    """Each link's origin in base_link's frame at rest."""
    places = {"": np.zeros(3)}
    for link in rover.links:
        places[link.name] = places[link.parent] + link.origin
    return places


def test_two_halves_weigh_and_turn_like_the_whole():
    halves = [(shape("box", (0.5, 0.3, 0.2), (x, 0.1, 0)), 2.0) for x in (-0.25, 0.25)]
    mass, centre, inertia = combine(halves)
    assert mass == 4.0
    np.testing.assert_allclose(centre, (0, 0.1, 0), atol=1e-15)
    np.testing.assert_allclose(inertia, solid_inertia(shape("box", (1.0, 0.3, 0.2)), 4.0))


@pytest.mark.parametrize(
    ("kind", "size"), [("box", (0.3, 0.5, 0.9)), ("cylinder", (0.3, 0.8)), ("sphere", (0.4,))]
)
def test_inertia_equals_that_of_the_meshed_solid(kind, size):
    import trimesh

    rpy = (0.3, -0.4, 1.1)
    mesh = {
        "box": lambda: trimesh.creation.box(size),
        "cylinder": lambda: trimesh.creation.cylinder(*size, sections=400),
        "sphere": lambda: trimesh.creation.icosphere(5, *size),
    }[kind]()
    placement = np.eye(4)
    placement[:3, :3] = matrix_from_quaternion(quaternion_from_rpy(np.array(rpy)))
    mesh.apply_transform(placement)
    mesh.density = 3.0 / mesh.volume
    np.testing.assert_allclose(
        solid_inertia(shape(kind, size, rpy=rpy), 3.0), mesh.moment_inertia, rtol=2e-3, atol=1e-4
    )


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
    places = origins(rover)
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
    places = origins(rover)
    centre = sum(link.mass * (places[link.name] + link.centre_of_mass) for link in rover.links)
    centre /= rover.mass
    assert abs(centre[0]) < 0.02
    assert abs(centre[1]) < 1e-12
    assert np.arctan(0.5 * 0.76 / centre[2]) > rover.tilt_limit


def test_dimensions_change_the_rover():
    wide = morpheus(MorpheusDimensions(track=1.0, wheel_mass=3.3))
    assert wide.width == pytest.approx(1.12)
    assert wide.mass == pytest.approx(56.0)


@pytest.mark.parametrize("change", [{"wheel_radius": 0.0}, {"body": (0.7, -0.4, 0.2)}])
def test_impossible_dimensions_are_refused(change):
    with pytest.raises(ValueError, match=f"{next(iter(change))} is .*must be greater than 0"):
        morpheus(MorpheusDimensions(**change))


def test_stereo_cameras_stand_a_baseline_apart_and_look_down():
    left, right = (s for s in morpheus().sensors if s.kind == "camera")
    np.testing.assert_allclose(left.position - right.position, (0, 0.12, 0), atol=1e-15)
    forward = matrix_from_quaternion(quaternion_from_rpy(left.rpy))[:, 0]
    assert forward[2] == pytest.approx(-np.sin(np.radians(12)))


def test_rovers_are_found_by_name():
    assert find_rover("morpheus") == morpheus()
    with pytest.raises(RecipeError, match=r"unknown rover 'morfeus', did you mean 'morpheus'\?"):
        find_rover("morfeus")
    with pytest.raises(RecipeError, match=f"known: {', '.join(rover_names())}"):
        find_rover("tank")
