"""The truth about a world, as files: rasters, tables, size-frequency verification."""

from .bundle import write_truth as write_truth
from .craters import craters_of as craters_of
from .materials import MATERIALS as MATERIALS
from .materials import merge_materials as merge_materials
from .merging import write_merged as write_merged
from .rasters import rock_rasters as rock_rasters
from .size_frequency import shape_figures as shape_figures
from .tiled import disjoint as disjoint
from .tiled import require_parquet as require_parquet
from .tiled import write_tile_truth as write_tile_truth
from .traversability import rate_world as rate_world
from .traversability import write_surroundings as write_surroundings
