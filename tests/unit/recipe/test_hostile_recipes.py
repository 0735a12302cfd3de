"""Recipes and tables that break readers cost one line, which names the place."""

from __future__ import annotations

import os

import pytest

from tests.helpers.command_line import run

RECIPE = """schema: 1
name: mini
seed: 1
body: moon
dtm: {kind: flat, size_m: [3, 2]}
terrain:
  spacing_m: 0.25
"""


def complaint(path) -> str:
    done = run("check", path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    assert all(c.isprintable() for c in done.stderr[:-1])
    return done.stderr


@pytest.mark.parametrize(
    ("seed", "says"),
    [
        (b"\x00", ":3: not YAML: special characters"),
        (b"\xc3\x28", ":3: is no text in UTF-8"),
        (b"[" * 5000, ":3: mappings and lists are nested more than 50 deep"),
        (b"[" * 60 + b"]" * 60, ":3: mappings and lists are nested more than 50 deep"),
        (b"9" * 5000, ":3: seed: a number of 5,000 digits, at most 400"),
        (b"9" * 50, ":3: seed: must be less than"),
        (b"1\nname: \x1b[31m", "special characters are not allowed"),
        (b'1\n"\\e[31m\\n": 2', ":4: \\x1b[31m\\n: unknown key"),
        (b"&a 1\nbody: *a", ":3: seed: YAML anchor"),
        (b"042", ":3: seed: 042 may be read as octal"),
        (b"[" + b"1," * 40_001 + b"]", ":3: not YAML: more than 40,000 keys and values"),
        (b"[" + b"0.123456, " * 2_000 + b"]", ":3: seed: must be a valid integer"),
        (b"#" * 2_000_000, "at most 0.25 MiB"),
        (b'1\nname: "\\uD800"', ":4: name: half of a UTF-16 character (\\ud800 to"),
        (b'1\n"\\uD800": 2', ":4: a key must be a word"),
        (b"1\n? [a]\n: 2", ":4: a key must be a word"),
    ],
)
def test_the_text_of_a_recipe(tmp_path, seed, says):
    path = tmp_path / "mini.yaml"
    path.write_bytes(RECIPE.encode().replace(b"seed: 1", b"seed: " + seed))
    assert says in complaint(path)


def test_what_does_not_end(tmp_path):
    pipe = tmp_path / "pipe.yaml"
    os.mkfifo(pipe)
    assert "is no regular file" in complaint(pipe)
    (tmp_path / "zero.yaml").symlink_to("/dev/zero")
    assert "is no regular file" in complaint(tmp_path / "zero.yaml")
    assert "File name too long" in complaint(tmp_path / f"{'x' * 300}.yaml")


ROUTE = "paths: [{{name: way, speed_m_s: 1, route: {{{}}}}}]\n"
LAYER = "  layers: [{{{}}}]\n"
LAW = (
    "rocks: {{library: {{shapes: 1}}, populations: "
    "[{{name: a, diameter_m: [0.3, 0.8], size_frequency: {{kind: {}}}}}]}}\n"
)


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (ROUTE.format("kind: file, file: PIPE"), ":8: paths[0].route.file: is no regular file"),
        (ROUTE.format("points_m: [[0, 0], [1.0e+6, 0]]"), "a route of 1e+06 m, at most 100,000 m"),
        (ROUTE.format("kind: polyline, points_m: [[0, 0], [1.0e+6, 0]]"), "at most 100,000 m"),
        (ROUTE.format("kind: spiral, length_m: 1.0e+6"), "paths[0].route: a route of 1e+06 m"),
        (ROUTE.format("kind: spiral, length_m: 1.0e+13"), "must be less than or equal to"),
        (ROUTE.format("points_m: [[0, 0], [1.0e+300, 0]]"), "must be less than or equal to"),
        (LAYER.format("kind: ripples, wavelength_m: 1.0e+12"), "less than or equal to 10000"),
        (LAYER.format("kind: fractal, gain: 100, deviation_1m_m: 10"), "an RMS slope of 90.0°"),
        (LAW.format("exponential, number_per_m2: 1, decay_per_m: 1.0e-6"), "or equal to 0.01"),
        (LAW.format("golombek, k: 0.1, q_per_m: 1.0e-12"), "or equal to 0.01"),
        ("exports: {a: {kind: mjcf, timestep_s: 1.0e-12}}\n", "or equal to 0.0001"),
        ("rocks: {library: {shapes: 0}}\n", "0 shapes and no meshes"),
        ("rocks: {exclusion_zones: [{centre_m: [0, 0], radius_m: 1.0e-300}]}\n", "or equal to"),
        ("rocks: {lists: [{name: a, file: PIPE}]}\n", "rocks.lists[0].file: is no regular file"),
    ],
)
def test_what_a_recipe_says(tmp_path, more, says):
    os.mkfifo(tmp_path / "PIPE")
    path = tmp_path / "mini.yaml"
    path.write_text(RECIPE + more)
    assert says in complaint(path)


def test_a_pipe_beside_a_raster(tmp_path):
    (tmp_path / "dem.img").write_bytes(bytes(64))
    os.mkfifo(tmp_path / "dem.hdr")
    assert "dem.hdr beside dem.img is no regular file" in complaint(tmp_path / "dem.img")


def test_arguments(tmp_path):
    path = tmp_path / "mini.yaml"
    path.write_text(RECIPE)
    deep = run("check", path, "--set", f"seed={'[' * 3000}")
    assert (deep.returncode, "not YAML: mappings and lists are nested" in deep.stderr) == (2, True)
    long = run("build", path, "-o", tmp_path / ("x" * 300))
    assert (long.returncode, "300 bytes long, at most 255" in long.stderr) == (2, True)
    odd = run("build", path, "-o", tmp_path / "a\udcff")
    assert (odd.returncode, "its name is no text in UTF-8" in odd.stderr) == (2, True)


def test_lines_of_a_table(tmp_path):
    path = tmp_path / "mini.yaml"
    path.write_text(RECIPE + "rocks: {lists: [{name: a, file: many.csv}]}\n")
    (tmp_path / "many.csv").write_text("x_m,y_m,diameter_m\n" + "\r" * 5_000_000)
    assert "has 5,000,001 lines, at most 4,000,000" in complaint(path)
    (tmp_path / "many.csv").write_bytes(b"x_m,y_m,diameter_m\n0,0,1\n\xff")
    assert "many.csv:3: is no text in UTF-8" in complaint(path)


@pytest.mark.parametrize("number", ["1_0", "\u0663"])
def test_numbers_of_a_table_are_plain(tmp_path, number):
    path = tmp_path / "mini.yaml"
    (tmp_path / "a.csv").write_text(f"x_m,y_m,diameter_m\n{number},0,1\n", encoding="utf-8")
    path.write_text(RECIPE + "rocks: {lists: [{name: a, file: a.csv}]}\n")
    assert "a.csv, line 2: x_m must be a number, found" in complaint(path)
    (tmp_path / "a.csv").write_text(f"x,y\n0,0\n{number},0\n", encoding="utf-8")
    path.write_text(RECIPE + ROUTE.format("kind: file, file: a.csv").replace("{{", "{"))
    assert "a.csv, line 3: x must be a number, found" in complaint(path)
