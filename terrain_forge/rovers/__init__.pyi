"""Rovers: those of ours, and the user's from URDF, xacro or MJCF."""

from .built_in import GrouserSpec as GrouserSpec
from .built_in import built_in_rovers as built_in_rovers
from .catalogue import RoverChoice as RoverChoice
from .catalogue import find_rover as find_rover
from .catalogue import require_ground as require_ground
from .catalogue import resolve_rover as resolve_rover
from .catalogue import rover_of as rover_of
from .custom import CouplingSpec as CouplingSpec
from .custom import FileRover as FileRover
from .doubts import doubt_unit as doubt_unit
from .doubts import doubts_of as doubts_of
from .doubts import told_radii as told_radii
from .rig import AnySensor as AnySensor
from .rig import MoreSensors as MoreSensors
from .rig import SensorsChoice as SensorsChoice
from .rig import with_sensors as with_sensors
from .rig_plain import rig_of as rig_of
