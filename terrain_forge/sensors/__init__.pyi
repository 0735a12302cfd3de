"""What a rover sees and feels: its motion, and instruments that measure it."""

from .allan import allan_deviation as allan_deviation
from .instrument import NANOSECONDS as NANOSECONDS
from .instrument import Frames as Frames
from .instrument import Instrument as Instrument
from .instrument import Series as Series
from .instrument import Setting as Setting
from .instrument import Stream as Stream
from .instrument import instrument_kinds as instrument_kinds
from .instrument import instruments_of as instruments_of
from .lens import OPTICAL as OPTICAL
from .likeness import ImageStatistics as ImageStatistics
from .likeness import image_statistics as image_statistics
from .links import RoverLinks as RoverLinks
from .links import rolled as rolled
from .motion import Curve as Curve
from .motion import Motion as Motion
from .motion import State as State
from .motion import motion_of_path as motion_of_path
from .mounts import check_mounts as check_mounts
from .scenery import Scenery as Scenery
from .sweep import Sweep as Sweep
from .sweep import deskewed_points as deskewed_points
from .sweep import point_classes as point_classes
from .sweep import take_sweep as take_sweep
