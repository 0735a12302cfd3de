"""Meshes and textures that exporters, pictures and pages share."""

from .ground_mesh import grid_faces as grid_faces
from .ground_mesh import grid_normals as grid_normals
from .ground_mesh import grid_texture_coordinates as grid_texture_coordinates
from .ground_mesh import grid_vertices as grid_vertices
from .ground_texture import bake_ground as bake_ground
from .ground_texture import detail_loss as detail_loss
from .ground_texture import detail_placement as detail_placement
from .ground_texture import finest_texture as finest_texture
from .ground_texture import texture_loss as texture_loss
from .rock_bodies import inertias as inertias
from .rock_bodies import principal_axes as principal_axes
from .rock_mesh import coarse_shape as coarse_shape
from .rock_mesh import collision_losses as collision_losses
from .rock_mesh import largest_outline_error as largest_outline_error
from .rock_mesh import merge_in_parts as merge_in_parts
from .rock_mesh import merge_rocks as merge_rocks
from .rock_mesh import static_losses as static_losses
from .rock_surface import level_of_detail as level_of_detail
from .rock_surface import surface as surface
from .rock_textures import mean_rock_colour as mean_rock_colour
from .rock_textures import rock_texture as rock_texture
from .rover_meshes import rover_mesh as rover_mesh
from .rover_meshes import write_rover_meshes as write_rover_meshes
