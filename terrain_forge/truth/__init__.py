"""The truth of a world: rasters, tables, and the proof of its rocks' size-frequency."""
