"""Where things lie that tests read: the project, its samples, and shared data where present."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
SAMPLES = ROOT / "dtm_samples"
DATA = ROOT.parent / "shared" / "data"
PROGRAMS = ROOT / "tests" / "consumers" / "programs"
