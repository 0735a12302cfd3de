"""Laws that expect next to no rocks, where libraries take the smallest numbers as 0."""

import json
import subprocess
import sys

import pytest

RARE = {
    "schema": 1,
    "name": "rare",
    "body": "mars",
    "dtm": {"kind": "flat", "size_m": [5, 4]},
    "terrain": {"spacing_m": 0.125},
    "rocks": {
        "library": {"shapes": 1},
        "populations": [
            {
                "name": "stones",
                "size_frequency": {
                    "kind": "exponential",
                    "number_per_m2": 5e-324,
                    "decay_per_m": 5,
                },
                "diameter_m": [0.1, 0.5],
            }
        ],
    },
    "exports": ["geotiff"],
}


@pytest.mark.slow
def test_so_few_rocks_that_a_logarithm_knows_none_are_built(tmp_path):
    (tmp_path / "rare.yaml").write_text(json.dumps(RARE))
    command = [sys.executable, "-m", "terrain_forge", "build", "rare.yaml"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, "Traceback" in done.stderr) == (0, False)
