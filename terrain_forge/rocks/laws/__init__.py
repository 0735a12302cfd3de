"""The size-frequency laws, a module each; terrain_forge.rocks.size_frequency finds them."""
