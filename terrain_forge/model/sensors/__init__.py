"""Kinds of sensors, a module each; `terrain_forge.model.sensor_kinds` finds them."""
