"""Recorded datasets: reading the master recording, and writing other formats from it."""

from .beside import FORMATS as FORMATS
from .beside import holds_format as holds_format
from .beside import made_formats as made_formats
from .beside import state_of as state_of
from .calibration import calibration_files as calibration_files
from .clouds import LidarMotion as LidarMotion
from .clouds import on_rover as on_rover
from .pictures import grey as grey
from .pictures import picture_of as picture_of
from .pictures import rectified_pair as rectified_pair
from .pictures import straight_stream as straight_stream
from .poses import Poses as Poses
from .poses import tum_text as tum_text
from .reader import INDEX as INDEX
from .reader import Recording as Recording
from .reader import StereoPair as StereoPair
from .reader import open_recording as open_recording
from .streams import RecordedCamera as RecordedCamera
from .streams import RecordedLidar as RecordedLidar
from .streams import RecordedSensor as RecordedSensor
from .streams import RecordedSeries as RecordedSeries
from .writer import DatasetWriter as DatasetWriter
from .writer import checked_options as checked_options
from .writer import dataset_kind as dataset_kind
from .writer import dataset_kinds as dataset_kinds
from .writer import write_dataset as write_dataset
