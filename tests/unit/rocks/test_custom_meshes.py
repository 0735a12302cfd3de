"""Users' meshes: every format, every defect, and what becomes of them in the library."""

import json
import re
import struct

import numpy as np
import pytest
import trimesh

from terrain_forge.base import DataError, cache_folder, require_gltf
from terrain_forge.model import CustomMesh, Mesh
from terrain_forge.recipe import InputFiles, input_paths
from terrain_forge.rocks import (
    LibrarySpec,
    RocksSpec,
    files_of_mesh,
    find_library,
    make_library,
    read_rock_mesh,
)
from terrain_forge.rocks.library import MeshSpec, library_key, store
from terrain_forge.rocks.shapes.carving import levels_of_detail
from terrain_forge.rocks.shapes.solid import cuts_itself, mass_properties
from tests.helpers.recipes import flat

KEY = ("rocks", "library", "meshes", 0, "file")


def rough_ball(subdivisions=3):
    """A lopsided, dented, asymmetric body of known volume."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    x, y, z = ball.vertices.T
    radius = 1.0 + 0.15 * np.sin(3 * x + 1) * np.cos(2 * y) - 0.1 * np.maximum(z, 0) ** 2
    return trimesh.Trimesh(ball.vertices * radius[:, None] * (1.5, 1.0, 0.7), ball.faces)


def hook():
    """A bent bar: not star-shaped about any point."""
    outer = trimesh.creation.box((3.0, 1.0, 3.0))
    cut = trimesh.creation.box((2.0, 2.0, 2.0)).apply_translation((0.8, 0.05, 0.8))
    bar = trimesh.boolean.difference([outer, cut])
    return bar.subdivide().subdivide()


def written(tmp_path, body, name):
    path = tmp_path / name
    body.export(path)
    return path


def refused(path):
    with pytest.raises(DataError) as caught:
        read_rock_mesh(path, key=KEY)
    assert caught.value.key == KEY
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("ending", ["obj", "stl", "ply", "glb"])
def test_every_format_gives_the_same_body(tmp_path, ending):
    body = rough_ball()
    if ending == "glb":  # y is up in glTF
        body.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0)))
    mesh, _ = read_rock_mesh(written(tmp_path, body, f"rock.{ending}"), key=KEY)
    assert mass_properties(mesh).volume == pytest.approx(rough_ball().volume, rel=1e-4)
    extents = np.ptp(mesh.vertices, axis=0)
    np.testing.assert_allclose(extents, rough_ball().extents, rtol=1e-4)
    assert len(mesh.vertices) == len(rough_ball().vertices)
    wanted = rough_ball().center_mass - rough_ball().bounds.mean(axis=0)
    np.testing.assert_allclose(mass_properties(mesh).centre, wanted, atol=1e-3)


def test_inside_out_and_mixed_winding_are_repaired(tmp_path):
    body = rough_ball()
    flipped = trimesh.Trimesh(body.vertices, body.faces[:, ::-1], process=False)
    mesh, repairs = read_rock_mesh(written(tmp_path, flipped, "in.ply"), key=KEY)
    assert mass_properties(mesh).volume == pytest.approx(body.volume, rel=1e-4)
    assert "turned inside out" in repairs
    faces = body.faces.copy()
    faces[::7] = faces[::7, ::-1]
    mixed = trimesh.Trimesh(body.vertices, faces, process=False)
    mesh, repairs = read_rock_mesh(written(tmp_path, mixed, "mixed.ply"), key=KEY)
    assert mass_properties(mesh).volume == pytest.approx(body.volume, rel=1e-4)
    assert any("faces turned" in repair for repair in repairs)


def test_small_holes_and_doubled_faces_are_repaired(tmp_path):
    body = rough_ball()
    kept = np.delete(body.faces, [0, 400, 800], axis=0)
    faces = np.vstack([kept, kept[100:103], kept[200:201, [0, 1, 1]]])
    holed = trimesh.Trimesh(body.vertices, faces, process=False)
    mesh, repairs = read_rock_mesh(written(tmp_path, holed, "holes.ply"), key=KEY)
    assert trimesh.Trimesh(mesh.vertices, mesh.faces).is_watertight
    assert mass_properties(mesh).volume == pytest.approx(body.volume, rel=0.01)
    assert any("small holes filled" in repair for repair in repairs)
    assert any("dropped" in repair for repair in repairs)


def test_overlapping_bodies_are_united(tmp_path):
    one = trimesh.creation.box((2, 2, 2))
    both = trimesh.util.concatenate([one, one.copy().apply_translation((1, 0.5, 0.25))])
    mesh, repairs = read_rock_mesh(written(tmp_path, both, "two.stl"), key=KEY)
    assert mass_properties(mesh).volume == pytest.approx(16 - 1 * 1.5 * 1.75, rel=1e-6)
    assert "2 bodies united" in repairs


def test_bad_files_are_refused_with_the_reason(tmp_path):
    body = rough_ball()
    assert "no such file" in refused(tmp_path / "none.obj")
    (tmp_path / "rock.blend").write_bytes(b"BLENDER")
    assert "allowed: .obj" in refused(tmp_path / "rock.blend")
    (tmp_path / "broken.glb").write_bytes(b"glTFnonsense" * 9)
    assert "is no readable GLB: truncated" in refused(tmp_path / "broken.glb")
    (tmp_path / "empty.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    assert "holds no faces" in refused(tmp_path / "empty.obj")
    upper = trimesh.Trimesh(body.vertices, body.faces[body.triangles_center[:, 2] > -0.2])
    assert "is open: a hole of" in refused(written(tmp_path, upper, "open.obj"))
    flat = trimesh.Trimesh(body.vertices * (1, 1, 0), body.faces, process=False)
    assert "encloses no volume" in refused(written(tmp_path, flat, "flat.ply"))
    apart = trimesh.util.concatenate([body, body.copy().apply_translation((9, 0, 0))])
    assert "2 bodies that do not overlap" in refused(written(tmp_path, apart, "apart.ply"))
    pushed = body.vertices.copy()
    pushed[np.argmax(pushed[:, 2])] = (0.1, 0.05, -3.0)
    crossed = trimesh.Trimesh(pushed, body.faces, process=False)
    assert "cuts itself" in refused(written(tmp_path, crossed, "crossed.ply"))
    fin = np.vstack([body.faces, [[*body.faces[0, :2], int(body.faces[500, 0])]]])
    finned = trimesh.Trimesh(body.vertices, fin, process=False)
    assert "more than two faces" in refused(written(tmp_path, finned, "fin.ply"))


@pytest.mark.parametrize("ending", ["obj", "stl", "ply", "glb"])
def test_truncated_and_foreign_files_have_a_reason_of_ours(tmp_path, ending):
    whole = written(tmp_path, rough_ball(), f"whole.{ending}").read_bytes()
    own = re.compile(
        f"^bad.{ending}: .*(is no readable {ending.upper()}: truncated or of another format"
        "|is truncated: faces name|is open: )"
    )
    bad = tmp_path / f"bad.{ending}"
    cuts = [10, len(whole) // 3, 2 * len(whole) // 3, len(whole) - len(whole) // 20]
    for content in [whole[:cut] for cut in cuts] + [b"\x00\xff\x89PNG\r\n" * 40, b""]:
        bad.write_bytes(content)
        assert own.search(refused(bad)), content[:20]
    other = "ply" if ending != "ply" else "stl"
    bad.write_bytes(written(tmp_path, rough_ball(), f"other.{other}").read_bytes())
    assert own.search(refused(bad))


def test_an_obj_that_lacks_vertices_or_its_end_is_noticed(tmp_path):
    text = written(tmp_path, rough_ball(), "whole.obj").read_text()
    lines = text.splitlines()
    vertices = [line for line in lines if line.startswith("v ")]
    fewer = [line for line in lines if line != vertices[-1]]
    path = tmp_path / "cut.obj"
    path.write_text("\n".join(fewer) + "\n")
    count = len(vertices)
    assert f"is truncated: faces name {count} vertices, it holds {count - 1}" in refused(path)
    path.write_text(text.rstrip() + " ")
    _, repairs = read_rock_mesh(path, key=KEY)
    assert "its last line has no end: it may be truncated" in repairs
    path.write_text(text.rstrip() + "\n")
    assert read_rock_mesh(path, key=KEY)[1] == ()
    path.write_text(text.rstrip().rsplit(" ", 1)[0])
    assert "is no readable OBJ: truncated" in refused(path)


@pytest.mark.parametrize("offset", [1e3, 5e5, 4.6e6])
def test_a_mesh_on_a_maps_coordinates_is_the_same_rock(tmp_path, offset):
    """Centre of mass and inertia far from a file's origin are those at its origin."""
    body = rough_ball()
    far = body.copy()
    far.vertices += (offset, -2.0 * offset, 100.0)
    path = tmp_path / "far.obj"
    path.write_text(trimesh.exchange.obj.export_obj(far, digits=9))
    there, _ = read_rock_mesh(path, key=KEY)
    here, _ = read_rock_mesh(written(tmp_path, body, "here.obj"), key=KEY)
    one, other = mass_properties(there), mass_properties(here)
    assert one.volume == pytest.approx(other.volume, rel=1e-6)
    np.testing.assert_allclose(one.centre, other.centre, atol=1e-6)
    np.testing.assert_allclose(one.inertia, other.inertia, atol=1e-5)
    made = make_library(
        LibrarySpec(shapes=0, meshes=(MeshSpec(file="far.obj"),)),
        custom=(CustomMesh(path="far.obj", mesh=there, repairs=()),),
    )
    moments = np.linalg.eigvalsh(made.prototypes[0].inertia)
    assert moments[0] > 0.0
    assert moments[0] + moments[1] > moments[2]


@pytest.mark.parametrize("ending", ["stl", "ply", "glb"])
def test_digits_that_single_precision_has_cut_off_are_named(tmp_path, ending):
    far = rough_ball()
    far.vertices = (far.vertices + 2e6).astype(np.float32)
    if ending == "ply":
        path = tmp_path / "far.ply"
        path.write_text(quantised_ply(far))
    else:
        path = written(tmp_path, far, f"far.{ending}")
    reason = refused(path)
    assert "coordinates of about 2e+06 m in single precision leave only steps of 0.12 m" in reason


def quantised_ply(body):
    head = ["ply", "format ascii 1.0", f"element vertex {len(body.vertices)}"]
    head += [f"property float {axis}" for axis in "xyz"]
    head += [f"element face {len(body.faces)}", "property list uchar int vertex_indices"]
    rows = [" ".join(map(repr, vertex)) for vertex in body.vertices.tolist()]
    rows += ["3 " + " ".join(map(str, face)) for face in body.faces.tolist()]
    return "\n".join([*head, "end_header", *rows]) + "\n"


def test_bodies_that_meet_in_one_corner_are_refused(tmp_path):
    one = trimesh.creation.box((1, 1, 1))
    both = trimesh.util.concatenate([one, one.copy().apply_translation((1, 1, 1))])
    reason = refused(written(tmp_path, both, "pinch.ply"))
    assert "parts of it meet in a single corner, at 1 places" in reason
    edge = trimesh.util.concatenate([one, one.copy().apply_translation((1, 1, 0))])
    assert "more than two faces" in refused(written(tmp_path, edge, "edge.ply"))


def test_a_closed_cavity_is_filled(tmp_path):
    outer, inner = trimesh.creation.box((3, 3, 3)), trimesh.creation.box((1, 1, 1))
    inner.invert()
    hollow = trimesh.util.concatenate([outer, inner])
    for name, body in (("hollow.ply", hollow), ("inward.ply", hollow.copy())):
        if name == "inward.ply":
            body.invert()
        mesh, repairs = read_rock_mesh(written(tmp_path, body, name), key=KEY)
        assert mass_properties(mesh).volume == pytest.approx(27.0)
        assert repairs == (("turned inside out",) * (name == "inward.ply")) + ("cavity filled",)


@pytest.mark.parametrize("thickness", [0.0, 1e-9, 1e-6])
def test_flattened_meshes_enclose_no_volume(tmp_path, thickness):
    body = rough_ball()
    flat = trimesh.Trimesh(body.vertices * (1, 1, thickness), body.faces, process=False)
    path = tmp_path / "flat.obj"
    path.write_text(trimesh.exchange.obj.export_obj(flat, digits=15))
    assert "encloses no volume" in refused(path)


def test_a_hole_of_few_edges_may_still_be_too_large(tmp_path):
    """Half a box is open, though only six edges go around what it lacks."""
    box = trimesh.creation.box((1, 1, 1))
    for missing in (1, 2, 6):
        part = trimesh.Trimesh(box.vertices, box.faces[missing:], process=False)
        assert "is open: " in refused(written(tmp_path, part, "part.ply"))
    body = rough_ball()
    sieve = trimesh.Trimesh(body.vertices, scattered_out(body.faces, 90), process=False)
    assert "5% together" in refused(written(tmp_path, sieve, "sieve.ply"))


def scattered_out(faces, count):
    """Faces without so many of them, no two of which meet."""
    gone, touched = [], set()
    for number, face in enumerate(faces.tolist()):
        if len(gone) < count and not touched & set(face):
            gone.append(number)
            touched |= set(face)
    assert len(gone) == count
    return np.delete(faces, gone, axis=0)


def test_a_moebius_strip_has_no_inside(tmp_path):
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    rims = []
    for side in (-0.3, 0.3):
        radius = 1 + side * np.cos(turn / 2)
        rims.append(
            np.stack([radius * np.cos(turn), radius * np.sin(turn), side * np.sin(turn / 2)], 1)
        )
    faces = []
    for n in range(40):
        a, b = n, n + 40
        c, d = (n + 1, n + 41) if n < 39 else (40, 0)
        faces += [(a, c, b), (b, c, d)]
    strip = trimesh.Trimesh(np.vstack(rims), faces, process=False)
    assert "cannot all look outward" in refused(written(tmp_path, strip, "strip.ply"))


def custom(body, path):
    return CustomMesh(path=path, mesh=Mesh(vertices=body.vertices, faces=body.faces), repairs=())


@pytest.fixture(scope="module")
def own_library():
    own = (MeshSpec(file="shapes/hook.stl"), MeshSpec(file="ball.ply", family="mine", keep_up=True))
    spec = LibrarySpec(shapes=1, meshes=own, hull_excess=0.25, hull_distance=0.15)
    shapes = (custom(rough_ball(4), "ball.ply"), custom(hook(), "shapes/hook.stl"))
    return make_library(spec, custom=shapes)


def test_users_shapes_become_prototypes(own_library):
    assert [rock.family for rock in own_library.prototypes] == ["block", "hook", "mine"]
    for rock in own_library.prototypes[1:]:
        assert np.ptp(rock.meshes[0].vertices, axis=0).mean() == pytest.approx(1.0)
        np.testing.assert_allclose(mass_properties(rock.meshes[0]).centre, 0, atol=1e-9)
        assert rock.hull_excess <= 0.25
        assert rock.hull_distance <= 0.15
        for mesh in rock.meshes:
            body = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
            assert body.is_watertight
            assert body.volume > 0
            assert not cuts_itself(mesh)
            assert len(mesh.vertices) <= 962


def test_a_hook_keeps_its_gap(own_library):
    """It lies on its side, its three extents as they were, and its parts leave the gap open."""
    rock = own_library.prototypes[1]
    assert len(rock.hulls) > 1
    extents = np.sort(np.ptp(rock.meshes[0].vertices, axis=0))
    assert extents[0] / extents[2] < 0.4
    assert np.ptp(rock.meshes[0].vertices[:, 2]) == pytest.approx(extents[0], abs=1e-3)
    assert rock.volume / extents[0] ** 3 == pytest.approx(9 - 1.7 * 1.7, rel=0.01)


def test_levels_of_a_needle_have_fewer_faces_too():
    body = trimesh.creation.icosphere(subdivisions=3)
    turn = trimesh.transformations.rotation_matrix(0.7, (1, 2, 3))
    body.vertices *= (20, 1, 1)
    body.apply_transform(turn)
    close, *levels = levels_of_detail(Mesh(vertices=body.vertices, faces=body.faces))
    assert len(close.faces) == 1280
    assert [len(mesh.faces) for mesh in levels] == [1280, 476, 116]
    for mesh in levels:
        level = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        assert level.is_watertight
        assert level.volume == pytest.approx(body.volume, rel=0.15)
        np.testing.assert_allclose(level.extents, body.extents, rtol=0.05)
    assert not cuts_itself(levels[2])


def test_a_shape_that_keeps_up_is_only_scaled_and_moved(own_library):
    body = rough_ball(4)
    rock = own_library.prototypes[2]
    np.testing.assert_allclose(
        np.ptp(rock.meshes[0].vertices, axis=0), body.extents / body.extents.mean(), atol=0.01
    )


def test_cache_gives_the_same_bytes_once(tmp_path, monkeypatch):
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", str(tmp_path / "kept"))
    spec = LibrarySpec(shapes=1, seed=5)
    made = find_library(spec)
    (file,) = (tmp_path / "kept").iterdir()
    with monkeypatch.context() as patched:
        patched.setattr("terrain_forge.rocks.library.make_library", None)  # must not be called
        assert find_library(spec) == made
    assert make_library(spec).content_hash == made.content_hash
    file.write_bytes(file.read_bytes()[:-400])
    assert find_library(spec) == made
    file.write_bytes(b"nonsense")
    assert find_library(spec) == made
    assert [entry.name for entry in file.parent.iterdir()] == [file.name]


@pytest.fixture(scope="module")
def made():
    return make_library(LibrarySpec(shapes=1, seed=5))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("volume", 7.0),
        ("inertia", np.eye(3)),
        ("hull_excess", 0.5),
        ("hull_distance", 0.5),
        ("outline_errors", (0.0, 0.5, 0.5)),
        ("reach", 9.0),
        ("family", "other"),
    ],
)
def test_cache_notices_any_figure_that_is_not_its_own(tmp_path, monkeypatch, made, name, value):
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", str(tmp_path / "kept"))
    spec = LibrarySpec(shapes=1, seed=5)
    monkeypatch.setattr("terrain_forge.rocks.library.make_library", lambda *_, **__: made)
    assert find_library(spec) == made
    (file,) = (tmp_path / "kept").iterdir()
    rock = made.prototypes[0].replace(**{name: value})
    store(file, made.replace(prototypes=(rock,)))
    forged = dict(np.load(file))
    plain = json.loads(forged["plain"].tobytes())
    plain["content_hash"] = made.content_hash
    forged["plain"] = np.frombuffer(json.dumps(plain).encode(), np.uint8)
    np.savez(file, **forged)
    assert find_library(spec) == made


def test_cache_knows_the_users_home(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", "~/rocks")
    assert cache_folder() == tmp_path / "rocks"
    monkeypatch.delenv("TERRAIN_FORGE_CACHE")
    for told, base in ((tmp_path / "kept", tmp_path / "kept"), ("kept", tmp_path / ".cache")):
        monkeypatch.setenv("XDG_CACHE_HOME", str(told))
        assert cache_folder() == base / "terrain-forge"


def test_cache_can_be_off_or_out_of_reach(tmp_path, monkeypatch):
    spec = LibrarySpec(shapes=1, seed=5)
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", "off")
    assert cache_folder() is None
    made = find_library(spec)
    blocked = tmp_path / "file"
    blocked.write_text("no folder")
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", str(blocked))
    assert find_library(spec) == made


def test_cache_key_follows_wishes_and_meshes():
    one, other = custom(rough_ball(2), "a.ply"), custom(rough_ball(1), "a.ply")
    keys = {
        library_key(LibrarySpec(), ()),
        library_key(LibrarySpec(seed=1), ()),
        library_key(LibrarySpec(), (one,)),
        library_key(LibrarySpec(), (other,)),
    }
    assert len(keys) == 4
    assert library_key(LibrarySpec(), (one,)) in keys


@pytest.mark.parametrize("name", ["rock.obj", "rock.gltf"])
def test_files_beside_a_mesh_are_known(tmp_path, name):
    """What its materials name too; a texture is named and not read."""
    body, (bin_, mtl) = rough_ball(1), (tmp_path / "rock 1.bin", tmp_path / "rock.mtl")
    if name == "rock.obj":
        mtl.write_text("newmtl skin\nmap_Kd skin.png\nmap_Bump missing.png\n")
        text = trimesh.exchange.obj.export_obj(body, digits=15)
        (tmp_path / name).write_text(f"mtllib rock.mtl\nusemtl skin\n{text}\n")
        wanted = ["rock.mtl", "skin.png"]
    else:
        files = trimesh.exchange.gltf.export_gltf(body)
        tree = json.loads(files.pop("model.gltf"))
        buffers = b"".join(files[buffer["uri"]] for buffer in tree["buffers"])
        assert len(tree["buffers"]) == len(files)
        views = 0
        for view, buffer in zip(tree["bufferViews"], tree["buffers"], strict=True):
            view["buffer"], view["byteOffset"] = 0, views
            views += buffer["byteLength"]
        bin_.write_bytes(buffers)
        tree["buffers"] = [{"uri": "rock%201.bin", "byteLength": len(buffers)}]
        tree["images"] = [{"uri": "skin.png"}, {"uri": "data:image/png;base64,AAAA"}]
        (tmp_path / name).write_text(json.dumps(tree))
        wanted = ["rock 1.bin", "skin.png"]
    (tmp_path / "skin.png").write_bytes(b"no picture")
    assert [path.name for path in files_of_mesh(tmp_path / name)] == wanted
    mesh, _ = read_rock_mesh(tmp_path / name, key=KEY)
    assert mass_properties(mesh).volume == pytest.approx(body.volume, rel=1e-4)
    rocks = RocksSpec(library=LibrarySpec(meshes=(MeshSpec(file=name),)))
    recipe = flat((9.0, 9.0), 0.5, rocks=rocks)
    assert [path.name for path in input_paths(recipe, tmp_path)] == [name, *wanted]
    hashed = dict(InputFiles(recipe, tmp_path).hashes(patch=None, rover_files=()))
    assert [*hashed] == [name, *wanted]


def test_files_elsewhere_are_not_named(tmp_path):
    folder = tmp_path / "rocks"
    folder.mkdir()
    for name in ("secret.mtl", "rocks/own.mtl"):
        (tmp_path / name).write_text("newmtl a\nmap_Kd /etc/hostname\n")
    (folder / "link.mtl").symlink_to(tmp_path / "secret.mtl")
    names = ("../secret.mtl", "/etc/hostname", "/proc/kmsg", "link.mtl", "own.mtl")
    (folder / "rock.obj").write_text("".join(f"mtllib {name}\n" for name in names))
    assert files_of_mesh(folder / "rock.obj") == (folder / "own.mtl",)
    uris = ["../secret.mtl", "/etc/hostname", "own.mtl"]
    (folder / "rock.gltf").write_text(json.dumps({"buffers": [{"uri": one} for one in uris]}))
    assert files_of_mesh(folder / "rock.gltf") == (folder / "own.mtl",)


TRIANGLE = {"attributes": {"POSITION": 0}}
MANY = {"componentType": 5126, "count": 10**7, "type": "VEC3"}
FEW = {**MANY, "count": 3}


@pytest.mark.parametrize(
    "told",
    [
        {"accessors": [{**MANY, "count": 10**9}]},
        {"accessors": [MANY] * 100},
        {"accessors": [{**MANY, "count": 10**9}, {**MANY, "count": -(10**9)}]},
        {"accessors": [{**MANY, "count": float("nan")}]},
        {"accessors": [MANY], "meshes": [{"primitives": [TRIANGLE] * 100}]},
        {
            "accessors": [{**MANY, "count": 10**5}],
            "meshes": [{"primitives": [TRIANGLE]}],
            "nodes": [{"mesh": 0}] * 1000,
        },
        {
            "accessors": [FEW],
            "meshes": [{"primitives": [TRIANGLE]}],
            "nodes": [*({"children": [n + 1, n + 1]} for n in range(30)), {"mesh": 0}],
        },
    ],
)
@pytest.mark.parametrize("ending", ["gltf", "glb"])
def test_a_few_words_are_no_gigabytes(tmp_path, told, ending, monkeypatch):
    text = json.dumps({"asset": {"version": "2.0"}, **told}).encode()
    head = struct.pack("<4s4I", b"glTF", 2, 20 + len(text), len(text), 0x4E4F534A)
    (tmp_path / f"rock.{ending}").write_bytes((head if ending == "glb" else b"") + text)
    monkeypatch.setattr(trimesh, "load", None)  # it would make the arrays
    assert "is no readable" in refused(tmp_path / f"rock.{ending}")
    with pytest.raises(ValueError, match=r"too many numbers|nodes within themselves"):
        require_gltf((tmp_path / f"rock.{ending}").read_bytes(), most=40_000_000)
