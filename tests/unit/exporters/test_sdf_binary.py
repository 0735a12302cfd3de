"""The binary meshes of an SDF export: the same triangles as its text, in a third of the bytes."""

import subprocess

import numpy as np
import pytest
from terrain_forge.exporters.sdf import Options, export

from terrain_forge.validation import read_mesh
from tests.helpers.plain_readers import CORNERS, glb_corners

TILES = {"release": "garden", "tile_cells": 48, "sensors": False, "individual_min_m": 0.9}


@pytest.fixture(scope="module")
def written(small_world, tmp_path_factory):
    """The folders of a world with binary meshes and with text, by format."""
    folders = {}
    for form in ("glb", "obj"):
        folders[form] = tmp_path_factory.mktemp(form)
        export(small_world, folders[form], options=Options(mesh_format=form, **TILES))
    return folders


def pairs(folders):
    """The binary meshes and the text that stands for the same."""
    for path in sorted(folders["glb"].rglob("*.glb")):
        (other,) = folders["obj"].glob(f"{path.relative_to(folders['glb']).with_suffix('')}.*")
        yield path, other


def same_corners(found, path):
    """Whether corners are those of a file: 0.02 mm, and 0.0002 of normals and textures."""
    wanted = CORNERS[path.suffix](path)
    columns = 8 if path.suffix == ".obj" else 3  # an STL has other normals and no texture
    assert found.shape == wanted.shape
    worst = np.abs(found - wanted)[:, :columns].max(axis=0)
    assert (worst[:3] < 2e-5).all()
    assert (worst[3:] < 2e-4).all()


def test_binary_meshes_are_the_text(written):
    files = list(pairs(written))
    assert {path.stem.split("_")[0] for path, _ in files} == {"ground", "small"}
    for binary, text in files:
        same_corners(glb_corners(binary), text)
        ours, theirs = read_mesh(binary), read_mesh(text)
        triangles = [mesh.vertices[mesh.faces] for mesh in (ours, theirs)]
        assert np.abs(triangles[0] - triangles[1]).max() < 2e-5


def test_nothing_else_differs_and_it_is_small(written):
    sizes, texts = [], []
    for folder in written.values():
        meshes = [p for p in folder.rglob("*") if p.name.startswith(("ground_0", "small_0"))]
        sizes.append(sum(p.stat().st_size for p in meshes if p.suffix != ".png"))
        files = sorted(folder.rglob("*.sdf"))
        texts.append([p.read_text().replace(".glb", ".X") for p in files])
    assert sizes[0] < 0.35 * sizes[1]
    assert [t.replace(".obj", ".X").replace(".stl", ".X") for t in texts[1]] == [
        t.replace(".obj", ".X").replace(".stl", ".X") for t in texts[0]
    ]


@pytest.mark.consumer
def test_assimp_reads_them_as_gazebo_asks_it_to(written, build):
    program = build("assimp_mesh", "assimp")
    for binary, text in pairs(written):
        run = subprocess.run([program, binary], capture_output=True)
        assert run.returncode == 0, run.stderr
        same_corners(np.frombuffer(run.stdout, "<f4").reshape(-1, 8), text)
