"""The page's table of rocks, whatever they come from."""

from __future__ import annotations

import pytest

from tests.helpers.command_line import run

RECIPE = """
name: sources
body: mars
dtm: {kind: flat, size_m: [8, 6]}
terrain: {spacing_m: 0.25}
rocks:
  library: {shapes: 1}
  populations: [POPULATIONS]
  lists: [LISTS]
exports: []
"""
LAW = "{name: drawn, size_frequency: {kind: golombek, k: 0.1}, diameter_m: [0.2, 0.5]}"
LISTED = "{name: mapped, file: rocks.csv}"


@pytest.mark.parametrize(
    ("populations", "lists", "shown"),
    [
        ("", "", []),
        (LAW, "", ["drawn", "Expected cover"]),
        ("", LISTED, ["mapped", "as listed"]),
        (LAW, LISTED, ["drawn", "mapped", "as listed", "Expected cover"]),
    ],
    ids=["none", "law", "list", "both"],
)
@pytest.mark.slow
def test_worlds_of_any_sources_have_a_page(tmp_path, populations, lists, shown):
    (tmp_path / "rocks.csv").write_text("x_m,y_m,diameter_m\n1,1,0.6\n-2,-1,0.4\n")
    recipe = RECIPE.replace("POPULATIONS", populations).replace("LISTS", lists)
    (tmp_path / "sources.yaml").write_text(recipe)
    done = run("build", tmp_path / "sources.yaml", "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "out" / "report.html").read_text()
    assert [words for words in shown if words not in page] == []
