"""The documentation: its snippets run, its links lead to files, its made pages are current."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

from tests.helpers.places import ROOT

PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])


@pytest.mark.slow
def test_api_tour_runs(tmp_path, monkeypatch):
    """In order, in one namespace, as a reader would."""
    page = ROOT / "docs" / "api.md"
    text = page.read_text(encoding="utf-8")
    blocks = list(re.finditer(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL))
    assert len(blocks) > 10
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PKG_CONFIG_LIBDIR", "")  # no probe is compiled for Gazebo's library
    namespace: dict[str, object] = {"__name__": "tour"}
    for block in blocks:
        line = text.count("\n", 0, block.start(1))
        code = compile("\n" * line + block.group(1), str(page), "exec", dont_inherit=True)
        exec(code, namespace)
    assert (tmp_path / "garden" / "sdf" / "world.sdf").is_file()
    assert len((tmp_path / "points.xyz").read_text().splitlines()) == 97 * 129


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_links_lead_to_files(page):
    links = re.findall(r"\]\(([^)#]*)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    local = [link for link in links if link and "://" not in link]
    assert [link for link in local if not (page.parent / link).exists()] == []


def test_generated_pages_are_current():
    command = [sys.executable, ROOT / "docs" / "make_pages.py", "--check"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
