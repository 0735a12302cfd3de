"""The world as a small GLB, for the 3-D view of the report page."""
