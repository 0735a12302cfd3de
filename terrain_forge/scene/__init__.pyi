"""Ray-traced pictures of a world: rays, surfaces, light, cameras."""

from .bodies import Bodies as Bodies
from .bodies import BodyShapes as BodyShapes
from .bodies import PlacedBodies as PlacedBodies
from .bodies import cast_with_bodies as cast_with_bodies
from .bodies import meet8 as meet8
from .bodies import shade8 as shade8
from .camera import pinhole_camera as pinhole_camera
from .engine import before_compiling as before_compiling
from .engine import engine_name as engine_name
from .grain import CLAST_SHARE as CLAST_SHARE
from .grain import ground_grain as ground_grain
from .preview import render_from_above as render_from_above
from .preview import render_preview as render_preview
from .preview import take_picture as take_picture
from .preview import write_preview as write_preview
from .scene import APRON as APRON
from .scene import BODY as BODY
from .scene import GROUND as GROUND
from .scene import MISSED as MISSED
from .scene import Hits as Hits
from .scene import RayScene as RayScene
from .scene import open_scene as open_scene
from .subject import Instances as Instances
from .subject import Subject as Subject
from .subject import subject_of as subject_of
from .subject import tones as tones
