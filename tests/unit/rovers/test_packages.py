"""Which files a rover's file may name."""

from __future__ import annotations

import pytest

from terrain_forge.base import DataError
from terrain_forge.rovers.packages import Packages


@pytest.fixture
def ground(tmp_path, monkeypatch):
    """Folders as people have them, in the home of somebody called ada."""
    home = tmp_path / "home" / "ada"
    monkeypatch.setenv("HOME", str(home))
    for name in (
        *("plain/urdf/r.urdf", "plain/meshes/m.stl", "plain/notes/n.stl", "plain/urdf/sub/s.stl"),
        *("ws/src/kit/package.xml", "ws/src/kit/urdf/deep/r.urdf", "ws/src/kit/meshes/m.stl"),
        *("ws/src/arm/package.xml", "ws/src/arm/m.stl", "ws/src/bare/m.stl", "ws/far/m.stl"),
        *("ws/more/hand/package.xml", "ws/more/hand/m.stl"),
        *("old/kit/models/urdf/r.urdf", "old/kit/models/meshes/m.stl", "old/beside/m.stl"),
    ):
        (home / name).parent.mkdir(parents=True, exist_ok=True)
        (home / name).touch()
    (home / "plain/urdf/out.stl").symlink_to(home / "plain/notes/n.stl")
    (home / "plain/urdf/in.stl").symlink_to(home / "plain/meshes/m.stl")
    (home / "ws/src/linked").symlink_to(home / "ws/more/hand")
    (home / "ws/src/stray").symlink_to(home / "ws/far")
    return home


@pytest.mark.parametrize(
    ("file", "name", "found"),
    [
        ("plain/urdf/r.urdf", "../meshes/m.stl", "plain/meshes/m.stl"),
        ("plain/urdf/r.urdf", "sub/s.stl", "plain/urdf/sub/s.stl"),
        ("plain/urdf/r.urdf", "package://plain/meshes/m.stl", "plain/meshes/m.stl"),
        ("plain/urdf/r.urdf", "in.stl", "plain/meshes/m.stl"),
        ("plain/urdf/r.urdf", "model://plain/notes/n.stl", "plain/notes/n.stl"),
        ("plain/urdf/r.urdf", "file://HOME/plain/meshes/m.stl", "plain/meshes/m.stl"),
        ("plain/urdf/r.urdf", "../notes/n.stl", None),
        ("plain/urdf/r.urdf", "out.stl", None),
        ("plain/urdf/r.urdf", "file://HOME/plain/notes/n.stl", None),
        ("plain/urdf/r.urdf", "package://ada/plain/notes/n.stl", None),
        ("plain/urdf/r.urdf", "package://home/ada/plain/notes/n.stl", None),
        ("plain/urdf/r.urdf", "package://ws/far/m.stl", None),
        ("ws/src/kit/urdf/deep/r.urdf", "../../meshes/m.stl", "ws/src/kit/meshes/m.stl"),
        ("ws/src/kit/urdf/deep/r.urdf", "package://kit/meshes/m.stl", "ws/src/kit/meshes/m.stl"),
        ("ws/src/kit/urdf/deep/r.urdf", "package://arm/m.stl", "ws/src/arm/m.stl"),
        ("ws/src/kit/urdf/deep/r.urdf", "package://bare/m.stl", "ws/src/bare/m.stl"),
        ("ws/src/kit/urdf/deep/r.urdf", "package://linked/m.stl", "ws/more/hand/m.stl"),
        ("ws/src/kit/urdf/deep/r.urdf", "../../../arm/m.stl", None),
        ("ws/src/kit/urdf/deep/r.urdf", "package://stray/m.stl", None),
        ("ws/src/kit/urdf/deep/r.urdf", "package://far/m.stl", None),
        ("ws/src/kit/urdf/deep/r.urdf", "package://arm/../bare/m.stl", None),
        ("ws/src/kit/urdf/deep/r.urdf", "package://arm/../../far/m.stl", None),
        ("ws/src/kit/urdf/deep/r.urdf", "package:///etc/hostname", None),
        ("old/kit/models/urdf/r.urdf", "../meshes/m.stl", "old/kit/models/meshes/m.stl"),
        ("old/kit/models/urdf/r.urdf", "package://kit/models/meshes/m.stl",
         "old/kit/models/meshes/m.stl"),
        ("old/kit/models/urdf/r.urdf", "package://beside/m.stl", None),
    ],
)  # fmt: skip
def test_what_is_found_and_what_not(ground, file, name, found):
    packages = Packages({}, ground / file)
    name = name.replace("HOME", str(ground))
    if found is None:
        with pytest.raises(DataError, match=r"lies outside|is not found"):
            packages.path(name, (ground / file).parent)
    else:
        path = packages.path(name, (ground / file).parent)
        assert path.resolve() == (ground / found).resolve()


def test_the_recipe_opens_a_folder(ground):
    file = ground / "plain/urdf/r.urdf"
    packages = Packages({"far": ground / "ws/far", "notes": ground / "plain/notes"}, file)
    for name in ("package://far/m.stl", "package://notes/n.stl", "../notes/n.stl", "out.stl"):
        assert packages.path(name, file.parent).is_file()
