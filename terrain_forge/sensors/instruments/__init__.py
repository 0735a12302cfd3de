"""Instruments, a module each; `terrain_forge.sensors.instrument_kinds()` finds them."""
