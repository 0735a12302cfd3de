"""Fast writers of file formats that several rooms share."""

from .digits import put_integer as put_integer
from .digits import put_number as put_number
from .geotiff import write_geotiff as write_geotiff
from .glb import LARGEST_FILE as LARGEST_FILE
from .glb import Gltf as Gltf
from .image import encode_png as encode_png
from .image import write_png as write_png
from .lettering import figure_text as figure_text
from .mesh import Floats as Floats
from .mesh import Indices as Indices
from .mesh import index_corners as index_corners
from .mesh import vertex_normals as vertex_normals
from .mesh import write_obj as write_obj
from .mesh import write_obj_faces as write_obj_faces
from .mesh import write_obj_rows as write_obj_rows
from .mesh import write_stl as write_stl
from .mesh import write_stl_faces as write_stl_faces
from .mesh import write_stl_header as write_stl_header
from .mtl import MattMaterial as MattMaterial
from .mtl import write_mtl as write_mtl
from .naming import file_name as file_name
from .naming import identifier as identifier
from .obj_grid import write_obj_grid_faces as write_obj_grid_faces
from .table import Column as Column
from .table import quoted as quoted
from .table import write_table as write_table
