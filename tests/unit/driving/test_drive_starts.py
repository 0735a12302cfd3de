"""Many drives from random starts, and pictures of a drive."""

import csv
import json

import numpy as np
import pytest
from PIL import Image, ImageSequence
from terrain_forge.exporters import mjcf

from terrain_forge.base import SimulationError
from terrain_forge.driving.film import link_poses, photograph, write_end, write_film
from terrain_forge.driving.starts import drive_from_many_starts, line_from_start
from terrain_forge.recipe import StartsSpec, ValidateSpec
from terrain_forge.validation import validate
from terrain_forge.validation.checks.drives import belly_points, measure_clearance
from tests.helpers import worlds
from tests.helpers.rovers import morpheus
from tests.unit.driving.test_drive import ARC, boulder_at, drive_through, line, plain

SPEC = StartsSpec(count=3, length_m=2.0)


@pytest.fixture(scope="module")
def land():
    return worlds.world(rover=morpheus())


@pytest.fixture(scope="module")
def across_a_rock(tmp_path_factory):
    """A drive between whose wheels a rock passes, which no wheel touches."""
    world = plain(line((-2, 0), (2, 0)), field=boulder_at((0.0, 0.0, -0.72)))
    field = world.field.replace(scale=world.field.scale * 0.16, position=[[0.0, 0.0, 0.05]])
    world = world.replace(field=field)
    return world, drive_through(world, tmp_path_factory.mktemp("rock"))


def test_starts_are_drawn_by_their_number_and_are_free(land):
    lines = [line_from_start(land, StartsSpec(count=50, length_m=3.0), n) for n in range(50)]
    again = line_from_start(land, StartsSpec(count=1, length_m=3.0), 7)
    assert again == lines[7]
    starts = np.array([line.position[0, :2] for line in lines])
    ends = np.array([line.position[-1, :2] for line in lines])
    np.testing.assert_allclose(np.linalg.norm(ends - starts, axis=1), 3.0)
    assert land.ground.holds(np.vstack([starts, ends]), margin=0.5)
    gaps = np.linalg.norm(starts[:, None] - land.field.position[:, :2], axis=2)
    high = land.field.height > 0.07
    assert high.sum() > 20
    assert (gaps > 0.5 * land.field.diameter + 0.5)[:, high].all()
    headings = np.array([line.rpy[0, 2] for line in lines])
    assert len(np.unique(np.floor(headings / (np.pi / 2)))) == 4


@pytest.mark.slow
def test_they_go_the_same_in_one_process_and_in_two(land, tmp_path):
    mjcf.export(land, tmp_path, options=mjcf.Options())
    alone = drive_from_many_starts(land, tmp_path / "scene.xml", SPEC, processes=1)
    together = drive_from_many_starts(land, tmp_path / "scene.xml", SPEC, processes=2)
    assert alone == together
    assert len(alone.starts) == 3
    assert alone.share == sum(start.arrived for start in alone.starts) / 3


def test_a_killed_process_is_told(land, tmp_path, monkeypatch):
    killed = [(None, OSError("its process ended: signal 9"))]
    monkeypatch.setattr("terrain_forge.driving.starts.run_tasks", lambda *_, **__: killed)
    with pytest.raises(SimulationError, match=r"drives was lost: .* signal 9"):
        drive_from_many_starts(land, tmp_path / "scene.xml", SPEC, processes=2)


def test_an_interrupted_validation_leaves_the_one_before(tmp_path, monkeypatch):
    def interrupt(**_):
        raise KeyboardInterrupt

    world = plain(line((-2, 0), (2, 0)))
    validate(world, tmp_path, spec=ValidateSpec(points=10))
    files = {f: f.read_bytes() for f in (tmp_path / "validation").iterdir()}
    monkeypatch.setattr("terrain_forge.validation.checks.drives.drive", interrupt)
    with pytest.raises(KeyboardInterrupt):
        validate(world, tmp_path, spec=ValidateSpec(points=10, drive=ARC))
    assert all(file.read_bytes() == content for file, content in files.items())


def test_ground_without_room_is_told(land):
    with pytest.raises(SimulationError, match="no free start of a drive of 100 m"):
        line_from_start(land, StartsSpec(count=1, length_m=100.0), 0)


def test_a_validation_writes_them(tmp_path):
    world = plain(line((-2, 0), (2, 0)))
    starts = StartsSpec(count=1, length_m=2.0, arrive=1.0)
    result = validate(world, tmp_path, spec=ValidateSpec(drives=starts, points=10))
    assert {file.name for file in result.files} >= {"drives.csv", "drives.png"}
    report = json.loads((tmp_path / "validation/report.json").read_text())
    assert report["drives"]["share_arrived"] == 1.0
    assert report["drives"]["failures"] == []
    check = next(c for c in result.checks if c.name == "drives: part that arrives")
    assert check.passed
    table = (tmp_path / "validation/drives.csv").read_text().splitlines()
    rows = list(csv.DictReader(table))
    assert [row["arrived"] for row in rows] == ["1"]
    assert all(float(row["progress_m"]) == pytest.approx(1.95, abs=0.06) for row in rows)


def test_free_height_is_what_a_rock_leaves(across_a_rock):
    world, driven = across_a_rock
    result = measure_clearance(world, driven)
    assert driven.completed
    top = float(worlds_top(world))
    over = np.abs(result.position[:, 0]) < 0.2
    assert result.clearance[over].min() == pytest.approx(world.rover.clearance - top, abs=0.03)
    away = np.abs(result.position[:, 0]) > 1.2
    np.testing.assert_allclose(result.clearance[away], world.rover.clearance, atol=0.01)


def worlds_top(world):
    """Height of the top of the world's one rock [m]."""
    field = world.field
    mesh = world.library.prototypes[field.prototype[0]].meshes[0]
    return field.position[0, 2] + field.scale[0] * mesh.vertices[:, 2].max()


def test_the_belly_lies_between_the_wheels():
    rover = morpheus()
    belly = belly_points(rover)
    assert (belly[:, 2] == rover.clearance).all()
    assert np.abs(belly[:, 1]).max() == pytest.approx(0.38 - 0.06)
    assert np.ptp(belly[:, 0]) == pytest.approx(0.84)


def test_links_stand_where_physics_has_them(across_a_rock):
    """Wheels' centres by the record's kinematics lie at their radius above the flat ground."""
    world, result = across_a_rock
    poses = link_poses(world.rover, result, 3)
    for wheel in world.rover.wheels:
        assert poses[wheel.link][0][2] == pytest.approx(wheel.radius, abs=0.004)


def test_the_rover_is_in_its_picture(across_a_rock):
    world, result = across_a_rock
    image = photograph(world, result, 0, width=160, height=90).astype(int)
    bare = world.replace(rover=world.rover.replace(links=world.rover.links[:1]))
    fewer = photograph(bare, result, 0, width=160, height=90).astype(int)
    changed = np.abs(image - fewer).sum(axis=2) > 60
    assert 0.01 < changed.mean() < 0.3
    rows, columns = changed.nonzero()
    assert 30 < rows.mean() < 80
    assert 60 < columns.mean() < 100


def test_a_rover_without_a_look_can_be_filmed(across_a_rock, tmp_path, monkeypatch):
    monkeypatch.setattr("terrain_forge.driving.film.FRAMES", 2)
    world, result = across_a_rock
    links = tuple(
        link.replace(shapes=tuple(shape.replace(visible=False) for shape in link.shapes))
        for link in world.rover.links
    )
    unseen = world.replace(rover=world.rover.replace(links=links))
    seen = photograph(world, result, 0, width=160, height=90)
    assert not np.array_equal(photograph(unseen, result, 0, width=160, height=90), seen)
    assert len(frames_of(write_film(unseen, result, tmp_path / "drive.webp"))) == 2


def frames_of(film):
    """The frames of an animated picture, 8 bits each."""
    with Image.open(film) as picture:
        frames = ImageSequence.all_frames(picture)
        return [np.asarray(frame.convert("RGB"), float) for frame in frames]


def test_a_drive_becomes_a_film_and_its_end_a_picture(across_a_rock, tmp_path, monkeypatch):
    monkeypatch.setattr("terrain_forge.driving.film.FRAMES", 3)
    monkeypatch.setattr("terrain_forge.driving.film.END_SIZE", (192, 108))
    world, result = across_a_rock
    film = write_film(world, result, tmp_path / "drive.webp")
    with Image.open(film) as picture:
        assert picture.n_frames == 3
        assert picture.size == (400, 225)
    assert film.stat().st_size < 1.5e6 / 10
    with monkeypatch.context() as alone:  # frames look alike that each have a piece of the world
        alone.setattr("terrain_forge.driving.film.SHARED", 0.0)
        other = write_film(world, result, tmp_path / "alone.webp")
    for one, two in zip(frames_of(film), frames_of(other), strict=True):
        assert np.abs(one - two).mean() < 2.0
    with Image.open(write_end(world, result, tmp_path / "end.png")) as picture:
        assert picture.size == (192, 108)


def test_a_failed_drive_shows_where(tmp_path):
    world = plain(line((-2.4, 0), (2, 0)), field=boulder_at((0.0, 0.0, 0.2)))
    result = validate(world, tmp_path, spec=ValidateSpec(drive=ARC, points=10))
    assert not result.passed
    names = {file.name for file in result.files}
    assert "drive_arc_end.png" in names
    assert "drive_arc.webp" not in names
    assert result.drive.rocks == ("rock_3",)
    assert result.drive.reason.startswith(("stuck", "tipped", "left the path"))
    assert not {c.name: c.passed for c in result.checks}["drive arc: progress"]
    contact = result.drive.rock_contacts[0]
    report = json.loads((tmp_path / "validation/report.json").read_text())
    assert report["drive"]["rock_contacts"][0]["rock"] == contact.rock == "rock_3"
    assert contact.force > 10
    assert contact.duration > 0.1
    wheels = np.genfromtxt(tmp_path / "validation/drive_arc_wheels.csv", delimiter=",", names=True)
    torque = wheels["wheel_front_left_torque_n_m"]
    np.testing.assert_allclose(torque, result.drive.wheel_torque[:, 0], atol=1e-8)
