"""Studies: recipes with factors, built, recorded and evaluated over all of their levels."""

from .cells import Cell as Cell
from .cells import study_of as study_of
from .effects import MAIN as MAIN
from .effects import effect_rows as effect_rows
from .effects import effects_of as effects_of
from .effects import outcome_rows as outcome_rows
from .factors import Factor as Factor
from .factors import Level as Level
from .running import costs_of as costs_of
from .running import require_served as require_served
from .spec import read_study as read_study
from .spec import shipped_studies as shipped_studies
from .whole import run_study as run_study
