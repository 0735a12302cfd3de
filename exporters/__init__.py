"""The exporters that come with terrain-forge, one folder per format."""
