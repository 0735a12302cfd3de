"""One recipe makes the same bytes on every processor, as far as one machine can play others."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.helpers.places import SAMPLES

RECIPE = f"""
schema: 1
name: anywhere
seed: 5
body: mars
dtm: {{source: {SAMPLES / "gale_floor_synthetic.tif"}, size_m: [12, 10], level: plane}}
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
      dynamic_m: [0.3, 0.4]
    - name: clusters
      size_frequency: {{kind: power_law, exponent: 2.5, number_per_m2: 0.01}}
      diameter_m: [0.3, 0.8]
      arrangement: {{kind: clustered, clusters_per_m2: 0.02, radius_m: 1.5}}
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
OLD_NUMPY = {"NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR"}
FREE = ("timings.json", "manifest.json")


def built(folder: Path, **environment: str) -> dict[str, str]:
    """Hashes of all files of the world, built as a processor would that the environment plays."""
    recipe = folder / "anywhere.yaml"
    recipe.write_text(RECIPE)
    command = [sys.executable, "-W", "ignore", "-m", "terrain_forge", "build", recipe]
    out = folder / "-".join(["world", *environment.values()]).replace(" ", "_")
    done = subprocess.run(
        [*map(str, command), "-o", str(out)], env=os.environ | environment,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return dict(json.loads((out / "manifest.json").read_text())["outputs"])


def require_avx512() -> None:
    cpuinfo = Path("/proc/cpuinfo")
    if not cpuinfo.is_file() or "avx512f" not in cpuinfo.read_text():
        pytest.skip("needs a processor with AVX-512, to compare with one without")


def differing(one: dict[str, str], other: dict[str, str]) -> list[str]:
    return sorted(name for name in one | other if one.get(name) != other.get(name))


def test_a_world_is_the_same_with_and_without_avx512(tmp_path):
    require_avx512()
    new = built(tmp_path, OPENBLAS_CORETYPE="SkylakeX")
    old = built(tmp_path, OPENBLAS_CORETYPE="Haswell", **OLD_NUMPY)
    assert len(new) > 60
    assert differing(new, old) == []


@pytest.mark.slow
@pytest.mark.parametrize("target", ["x86-64-v3", "znver3"])
def test_kernels_compiled_for_other_processors_make_the_same_world(tmp_path, target):
    own = built(tmp_path)
    other = built(tmp_path, NUMBA_CPU_NAME=target, OPENBLAS_CORETYPE="Zen")
    assert differing(own, other) == []
