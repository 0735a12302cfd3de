"""`terrain-forge view`: opens the page, or says where it is, or why it cannot."""

import json

import pytest

from terrain_forge.cli import main
from tests.helpers.command_line import process_as_it_was


@pytest.fixture(autouse=True)
def _process():
    with process_as_it_was():
        yield


@pytest.fixture
def built(tmp_path):
    """A folder that has what `view` looks at."""
    manifest = {"terrain_forge": "0", "format": 2, "outputs": {}, "varying": [], "exports": {}}
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    (tmp_path / "report.html").write_text("<!DOCTYPE html>")
    return tmp_path


@pytest.fixture
def opened(monkeypatch):
    """The addresses that a browser was asked for."""
    found = []
    monkeypatch.setattr("webbrowser.open", lambda address: found.append(address) or True)
    return found


def test_the_page_is_opened(built, opened, monkeypatch, capsys):
    monkeypatch.setenv("DISPLAY", ":0")
    assert main(["view", str(built)]) == 0
    assert opened == [(built / "report.html").as_uri()]
    assert capsys.readouterr().out == f"{built / 'report.html'}\n"


def test_the_page_is_named_alone(built, opened, monkeypatch, capsys):
    monkeypatch.setenv("DISPLAY", ":0")
    assert main(["view", str(built), "--no-browser"]) == 0
    assert opened == []
    assert capsys.readouterr().out == f"{built / 'report.html'}\n"


@pytest.mark.parametrize("display", [True, False])
def test_without_a_browser_it_says_so(built, opened, monkeypatch, capsys, display):
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    if display:
        monkeypatch.setenv("DISPLAY", ":0")
        monkeypatch.setattr("webbrowser.open", lambda address: False)
    assert main(["view", str(built)]) == 0
    assert opened == []
    assert capsys.readouterr().out.endswith("open that file in one\n")


def test_a_world_without_its_page(built, capsys):
    (built / "report.html").unlink()
    assert main(["view", str(built)]) == 2
    error = capsys.readouterr().err
    assert "has no report page" in error
    assert f"terrain-forge validate {built}" in error


def test_a_folder_that_is_no_world(tmp_path, capsys):
    assert main(["view", str(tmp_path)]) == 2
    assert "terrain-forge: " in capsys.readouterr().err
