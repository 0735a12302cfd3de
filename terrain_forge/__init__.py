"""terrain-forge: planetary worlds for people who build and test rovers."""

__version__ = "0.1.0"
