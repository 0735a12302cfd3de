"""docs/datasets.md: its format of one's own works, and it tells of each option."""

from __future__ import annotations

import json
import re
from dataclasses import fields

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from terrain_forge.datasets import dataset_kinds
from tests.helpers import plugins
from tests.helpers.places import ROOT

PAGE = (ROOT / "docs" / "datasets.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", dataset_kinds())
def test_each_option_is_told(kind):
    assert f"| `{kind}` |" in PAGE
    names = [field.name for field in fields(dataset_kinds()[kind].Options)]
    assert [name for name in names if f"`{name}`" not in PAGE] == []


def test_poses_and_lenses_of_colmap_and_nerfstudio(recording, tmp_path, monkeypatch):
    blocks = re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    (block,) = (one for one in blocks if "transforms.json" in one)
    monkeypatch.chdir(tmp_path)
    exec(block.replace('"OUT"', repr(str(recording.folder))), {})
    camera = recording.cameras[0]
    told = (tmp_path / "colmap/cameras.txt").read_text().split()
    assert told[:4] == ["1", "PINHOLE", *map(str, camera.size)]
    place = np.array([7.0, 0.3, -0.2])
    fu, fv, cu, cv, *bent = map(float, told[4:])
    assert bent == camera.distortion[1].tolist()
    frames = json.loads((tmp_path / "colmap/transforms.json").read_text())["frames"]
    rows = (tmp_path / "colmap/images.txt").read_text().split("\n")[::2]
    poses = recording.truth_of(camera)
    assert len(frames) == len(rows) - 1 == len(poses) == 5
    for row, frame, pose in zip(rows, frames, poses.matrices, strict=False):
        _, *view, number, name = row.split()
        assert (number, name) == ("1", frame["file_path"])
        assert (recording.folder / "mav0" / name).is_file()
        w, x, y, z, *shift = map(float, view)
        seen = Rotation.from_quat([x, y, z, w]).apply(place) + shift
        own = np.linalg.inv(pose) @ [*place, 1.0]
        assert seen == pytest.approx(own[:3], abs=1e-9)
        ours = camera.matrix @ own[:3] / own[2]
        theirs = np.array([fu * seen[0], fv * seen[1]]) / seen[2] + (cu, cv)
        assert theirs == pytest.approx(ours[:2] + 0.5, abs=1e-6)
        opengl = np.linalg.inv(frame["transform_matrix"]) @ [*place, 1.0]
        assert opengl == pytest.approx(own * [1, -1, -1, 1], abs=1e-9)


def test_a_format_of_another_package(recording, tmp_path):
    blocks = re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    points = "[terrain_forge.datasets]\nposes = poses_format\n"
    site = plugins.install(tmp_path / "site", "poses", points, {"poses_format.py": blocks[-1]})
    with plugins.fresh(site):
        from terrain_forge.datasets import write_dataset

        report = write_dataset(recording.folder, "poses", tmp_path / "out", {"separator": ","})
    assert report.losses == ("Orientations are lost.",)
    rows = (tmp_path / "out" / "poses.txt").read_text().splitlines()
    assert len(rows) == 201
    assert rows[0].startswith("1600000000000000000,0.0,")
