"""Where things lie that tests read: the project, its samples, and shared data where present."""

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
SAMPLES = ROOT / "dtm_samples"
DATA = ROOT.parent / "shared" / "data"
PROGRAMS = ROOT / "tests" / "consumers" / "programs"


@cache
def parsed(path: Path) -> ast.Module:
    """What a file of Python says, for tests that read several of us."""
    return ast.parse(path.read_text(encoding="utf-8"))
