"""Recordings: what the sensors of a rover measure along a path, as a dataset on the disk."""

from .cost import RecordingCost as RecordingCost
from .cost import recording_cost as recording_cost
from .cost import recording_lines as recording_lines
from .cost import require_long_enough as require_long_enough
from .driven import motion_of_drive as motion_of_drive
from .early import require_recordable as require_recordable
from .index import dataset_folder as dataset_folder
from .order import Order as Order
from .record import RECORDING as RECORDING
from .record import Recorded as Recorded
from .record import record_dataset as record_dataset
from .setting import find_instrument as find_instrument
from .setting import open_setting as open_setting
