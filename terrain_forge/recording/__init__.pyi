"""Recordings: what the sensors of a rover measure along a path, as a dataset on the disk."""

from .driven import motion_of_drive as motion_of_drive
