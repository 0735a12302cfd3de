"""Ray-traced pictures of a world: rays, surfaces, light, cameras."""

from .camera import pinhole_camera as pinhole_camera
from .engine import before_compiling as before_compiling
from .engine import engine_name as engine_name
from .look import look as look
from .grain import CLAST_SHARE as CLAST_SHARE
from .grain import ground_grain as ground_grain
from .preview import render_from_above as render_from_above
from .preview import render_preview as render_preview
from .preview import take_picture as take_picture
from .preview import write_preview as write_preview
from .scene import GROUND as GROUND
from .scene import RayScene as RayScene
from .scene import open_scene as open_scene
from .stage import Stage as Stage
from .stage import Wheels as Wheels
from .stage import prepare_stage as prepare_stage
from .stage import prepare_wheels as prepare_wheels
from .subject import Instances as Instances
from .subject import Subject as Subject
from .subject import subject_of as subject_of
from .subject import tones as tones
