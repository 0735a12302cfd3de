"""What a shell is offered."""

import pytest
from click.shell_completion import BashComplete

from terrain_forge.cli import cli
from tests.helpers.command_line import run


def offered(*words):
    """The values that are offered for the last word."""
    shell = BashComplete(cli, {}, "terrain-forge", "_TERRAIN_FORGE_COMPLETE")
    return [item.value for item in shell.get_completions(list(words[:-1]), words[-1])]


def test_exporters_after_each_comma():
    assert {"sdf", "mjcf", "glb"} <= set(offered("build", "x.yaml", "--only", ""))
    assert offered("export", "out", "--only", "sdf,gl") == ["sdf,glb"]
    assert "sdf,sdf" not in offered("export", "out", "--only", "sdf,s")


def test_keys_one_step_at_a_time():
    assert offered("build", "x.yaml", "--set", "terr") == ["terrain."]
    assert offered("build", "x.yaml", "--set", "terrain.sp") == ["terrain.spacing_m="]
    assert offered("build", "x.yaml", "--set", "terrain.lay") == ["terrain.layers."]
    assert offered("check", "x.yaml", "--set", "rocks.populations.") == ["rocks.populations.0."]
    assert offered("check", "x.yaml", "--set", "rocks.populations.3.diam") == [
        "rocks.populations.3.diameter_m="
    ]
    assert offered("check", "x.yaml", "--set", "rocks.populations.0.size_frequency.k") == [
        "rocks.populations.0.size_frequency.kind=",
        "rocks.populations.0.size_frequency.k=",
    ]
    assert offered("check", "x.yaml", "--set", "validate.drive") == [
        *("validate.drive=", "validate.drive.", "validate.drives=", "validate.drives."),
    ]
    assert offered("check", "x.yaml", "--set", "exp") == ["exports=", "exports."]
    assert "exports.sdf.flavour=" in offered("check", "x.yaml", "--set", "exports.sdf.")
    assert offered("check", "x.yaml", "--set", "nothing.at.all") == []


def test_recipes_here_and_in_folders(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "recipes").mkdir()
    for name in ("mine.yaml", "recipes/hello.yaml", "recipes/notes.txt"):
        (tmp_path / name).touch()
    assert offered("build", "") == ["mine.yaml", "recipes/hello.yaml"]
    assert offered("build", "recipes/h") == ["recipes/hello.yaml"]
    assert offered("build", "other/") == ["other/"]  # the shell's own files
    assert offered("init", "--recipe", "moon_m") == ["moon_mare"]


def test_terrain_models_and_recipes_to_fetch(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "jezero_mine.yaml").touch()
    assert offered("fetch", "jez") == ["jezero", "jezero_mine.yaml"]
    assert offered("fetch", "jezero", "MOLA") == ["MOLA_463m"]


@pytest.mark.parametrize(
    ("shell", "mended"),
    [
        ("zsh", ["ends=(-S '')"]),
        ("fish", ["string split -m 1 "]),  # `sdf,mjcf` is one name
        ("bash", ["compopt -o nospace", "[[ -f $value ]] && compopt -o filenames"]),
    ],
)
def test_the_script_calls_us(shell, mended):
    script = run("completion", shell).stdout
    assert "_TERRAIN_FORGE_COMPLETE=" in script
    assert all(words in script for words in mended)
    assert script.count('"${ends[@]}"') == 2 * (shell == "zsh")
