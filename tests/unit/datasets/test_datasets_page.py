"""docs/datasets.md: its format of one's own works, and it tells of each option."""

from __future__ import annotations

import re
from dataclasses import fields

import pytest

from terrain_forge.datasets import dataset_kinds
from tests.helpers import plugins
from tests.helpers.places import ROOT

PAGE = (ROOT / "docs" / "datasets.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", dataset_kinds())
def test_each_option_is_told(kind):
    assert f"| `{kind}` |" in PAGE
    names = [field.name for field in fields(dataset_kinds()[kind].Options)]
    assert [name for name in names if f"`{name}`" not in PAGE] == []


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
