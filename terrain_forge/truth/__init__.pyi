"""The truth about a world, as files: rasters, tables, size-frequency verification."""

from .bundle import write_truth as write_truth
from .craters import craters_of as craters_of
from .rasters import rock_rasters as rock_rasters
from .size_frequency import shape_figures as shape_figures
from .traversability import rate_world as rate_world
