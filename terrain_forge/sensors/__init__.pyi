"""What a rover sees and feels: its motion, and instruments that measure it."""

from .instrument import Frames as Frames
from .instrument import Instrument as Instrument
from .instrument import Series as Series
from .instrument import Setting as Setting
from .instrument import Stream as Stream
from .instrument import instrument_kinds as instrument_kinds
from .motion import Curve as Curve
from .motion import Motion as Motion
from .motion import State as State
from .motion import motion_of_path as motion_of_path
from .picture import Exposure as Exposure
from .picture import take_exposure as take_exposure
from .picture import travelled as travelled
from .scenery import Scenery as Scenery
