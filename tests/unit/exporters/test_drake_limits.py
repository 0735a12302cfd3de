"""Worlds that Drake's parser would sit over, and a foreign rover in those that it takes."""

import numpy as np
import pytest
from terrain_forge.exporters.drake import Options, check_capacity, export
from terrain_forge.exporters.drake.options import (
    COARSENESS,
    MB_PER_FACE,
    WORTH_SAYING,
    parsing_load,
    require_parsable,
)

from terrain_forge.base import ExportError
from terrain_forge.rocks import LibrarySpec, make_library
from tests.consumers.test_drake import ask
from tests.helpers.rovers_sdf import HUB, WHEEL, four_wheeler
from tests.helpers.worlds import bare, crowded


@pytest.mark.slow
def test_too_many_rocks_of_their_own_are_refused_with_what_makes_it_less(small_world, tmp_path):
    world = crowded(small_world, 12_000)
    with pytest.raises(
        ExportError,
        match=r"load .* 12,000 static rocks .*at most 300 s .*; a larger individual_min_m or",
    ):
        export(world, tmp_path, options=Options(individual_min_m=0))
    assert not list(tmp_path.iterdir())
    options = Options(individual_min_m=1.25)
    load = require_parsable(world, options)
    assert 1_400 <= load.single <= 1_550
    assert load.bearable
    export(world, tmp_path, options=options)


def test_too_many_triangles_of_merged_rocks_are_refused(small_world, tmp_path):
    world = crowded(small_world, 60_000)
    with pytest.raises(ExportError, match=r"GB .*larger individual_min_m or .*smaller size_m"):
        export(world, tmp_path, options=Options(individual_min_m=9, outline_error=0.03))
    untouched = world.replace(field=world.field.replace(collides=np.zeros(60_000, np.bool_)))
    assert require_parsable(untouched, Options(individual_min_m=9)).bearable


def test_merged_rocks_are_as_coarse_as_the_parser_needs(small_world, monkeypatch):
    library = make_library(LibrarySpec(shapes=1))
    shape = library.prototypes[0].replace(outline_errors=(0.0, 0.02, 0.05))
    crowd = crowded(small_world, 900)
    alike = crowd.field.replace(prototype=np.zeros(900, np.int32))
    world = crowd.replace(library=library.replace(prototypes=(shape,)), field=alike)
    merged = Options(individual_min_m=9)
    fine, coarse = (parsing_load(world, merged, error) for error in (COARSENESS[0], COARSENESS[-1]))
    assert fine.faces > 1.5 * coarse.faces
    assert merged.merged_error(world) == COARSENESS[0]
    limit = MB_PER_FACE * 0.5 * (fine.faces + coarse.faces)
    monkeypatch.setattr("terrain_forge.exporters.drake.options.MOST_MB", limit)
    assert merged.merged_error(world) > COARSENESS[0]
    assert require_parsable(world, merged).bearable
    with pytest.raises(ExportError, match="larger individual_min_m or outline_error"):
        require_parsable(world, Options(individual_min_m=9, outline_error=COARSENESS[0]))


def test_the_triangles_are_those_that_are_written(small_world, tmp_path):
    world = crowded(small_world, 900)
    options = Options(individual_min_m=1.0)
    export(world, tmp_path, options=options)
    merged = ("ground_", "rocks_")
    lines = (
        line
        for path in tmp_path.glob("assets/*.obj")
        if path.name.startswith(merged)
        for line in path.read_bytes().splitlines()
    )
    written = sum(line.startswith(b"f ") for line in lines)
    single = world.field.prototype[world.field.diameter >= 1.0]
    finest = np.array([len(p.meshes[0].faces) for p in world.library.prototypes])
    assert require_parsable(world, options).faces == pytest.approx(
        written + finest[single].sum(), rel=0.02
    )


@pytest.mark.parametrize(("count", "said"), [(2_000, False), (2_600, True)])
def test_what_parsing_takes_is_said_from_twenty_seconds_on(small_world, tmp_path, count, said):
    losses = export(
        crowded(small_world, count), tmp_path, options=Options(individual_min_m=0)
    ).losses
    assert any("2,600 static rocks" in loss for loss in losses) == said


def test_too_many_dynamic_rocks_are_said_and_refused(small_world, tmp_path):
    lots = crowded(small_world, 4_100, dynamic=True)
    load = require_parsable(lots, Options())
    assert "4,100 dynamic ones" in str(load)
    assert load.seconds > WORTH_SAYING
    with pytest.raises(ExportError, match="fewer dynamic rocks make it less"):
        require_parsable(crowded(small_world, 61_000, dynamic=True), Options())


def test_a_ground_that_is_too_large_is_refused_before_it_is_made():
    check_capacity(Options(), nodes=1025**2, rocks=0)
    with pytest.raises(ExportError, match=r"16.8 M nodes .* larger spacing_m"):
        check_capacity(Options(), nodes=4097**2, rocks=0)


def test_dynamic_rocks_are_hard_and_damped_and_their_loss_is_told(small_world, tmp_path):
    field = small_world.field
    for name, dynamic in (("none", field.id < 0), ("some", np.arange(len(field)) == 5)):
        (tmp_path / name).mkdir()
        world = small_world.replace(field=field.replace(dynamic=dynamic))
        report = export(world, tmp_path / name, options=Options(tile_cells=48))
        text = (tmp_path / name / "world.sdf").read_text()
        soft = text.count("<drake:compliant_hydroelastic/>")
        assert (soft > 0) == (name == "some")
        assert text.count("<drake:hydroelastic_modulus>1e+09<") == soft
        assert text.count("<drake:hunt_crossley_dissipation>500<") == soft
        assert ("rolling friction" in " ".join(report.losses)) == (name == "some")


@pytest.mark.consumer
def test_a_foreign_rover_stands_on_drakes_ground(small_world, tmp_path):
    """Its wheels are round and say nothing of contact, as in a file written for Gazebo."""
    world = bare(small_world)
    (tmp_path / "drake").mkdir()
    export(world, tmp_path / "drake", options=Options(tile_cells=48))
    east, north = 0.0, 4.0
    height = float(world.ground.height_at(np.array([east]), np.array([north]))[0])
    rover = four_wheeler(east, north, height + 0.2, wheels="sphere")
    file = tmp_path / "rover.sdf"
    file.write_text(f'<sdf version="1.9">{rover}</sdf>', encoding="utf-8")
    x, y, z = ask(tmp_path / "drake", rovers=[str(file)], seconds=2)["places"]["foreign_rover"]
    below = float(world.ground.height_at(np.array([x]), np.array([y]))[0])
    assert z - below == pytest.approx(WHEEL - HUB, abs=0.03)
