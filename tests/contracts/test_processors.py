"""One recipe makes the same bytes in every process and on every processor, as far as one machine
can play others."""

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.helpers.command_line import run
from tests.helpers.places import ROOT, SAMPLES

RECIPE = f"""
schema: 1
name: anywhere
seed: 5
body: mars
dtm: {{source: {SAMPLES / "gale_floor_synthetic.tif"}, size_m: [9, 7], level: plane}}
terrain:
  spacing_m: 0.125
  layers:
    - {{kind: fractal}}
    - {{kind: craters, production: {{kind: hartmann_daubar, age_ga: 0.5}}, diameter_m: [1, 6]}}
    - {{kind: ripples, wavelength_m: 1.5, height_m: 0.03, wind_from_deg: 40}}
rocks:
  library: {{shapes: 3, seed: 2}}
  populations:
    - name: dynamic
      size_frequency: {{kind: golombek, k: 0.2}}
      diameter_m: [0.2, 0.5]
      dynamic_m: [0.2, 0.21]
    - name: clusters
      size_frequency: {{kind: power_law, exponent: 2.5, number_per_m2: 0.01}}
      diameter_m: [0.3, 0.8]
      arrangement: {{kind: clustered, clusters_per_m2: 0.05, radius_m: 1.5}}
paths:
  - name: arc
    route: {{kind: spline, points_m: [[-3, -2], [0, 1], [3, 2]]}}
    speed_m_s: 0.3
  - name: eight
    route: {{kind: figure_eight, length_m: 9}}
    speed_m_s: 0.3
    shake: {{rms_deg: 0.2, cutoff_hz: 2}}
rover: skid4
exports: [sdf, mjcf, usd, drake, glb, mesh, geotiff, rover]
"""
OLD = {
    "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR",
    "OPENBLAS_CORETYPE": "Haswell",
    "PYTHONHASHSEED": "77",
}
"""A processor without AVX-512, whatever this one has, and another order of sets."""


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """Hashes of all files of the world that is built here."""
    recipe = tmp_path_factory.mktemp("own") / "anywhere.yaml"
    recipe.write_text(RECIPE)
    done = run("build", recipe, "-o", recipe.with_name("out"))
    assert done.returncode == 0, done.stdout + done.stderr
    return outputs(recipe.with_name("out"))


def built(folder: Path, **environment: str) -> dict[str, str]:
    """Those of the world that another process builds, as the environment's processor would."""
    (folder / "anywhere.yaml").write_text(RECIPE)
    command = [sys.executable, "-W", "ignore", "-m", "tests.helpers.pictures"]
    environment |= {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [*command, "build", "anywhere.yaml"], env=os.environ | environment, cwd=folder,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return outputs(folder / "anywhere")


def outputs(world: Path) -> dict[str, str]:
    manifest = (world / "manifest.json").read_bytes()
    found = {"manifest.json": hashlib.sha256(manifest).hexdigest()}
    return found | json.loads(manifest)["outputs"]


def differing(one: dict[str, str], other: dict[str, str]) -> list[str]:
    return sorted(name for name in one | other if one.get(name) != other.get(name))


@pytest.mark.slow
def test_a_world_is_the_same_in_another_process_without_avx512(own, tmp_path):
    other = built(tmp_path, **OLD)
    assert len(own) > 60
    assert differing(own, other) == []


@pytest.mark.slow
def test_kernels_compiled_for_other_processors_make_the_same_world(own, tmp_path):
    other = built(tmp_path, NUMBA_CPU_NAME="x86-64-v3", OPENBLAS_CORETYPE="Zen")
    assert differing(own, other) == []
