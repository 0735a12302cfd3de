"""The checks of a built world, one module each."""
