"""The named shapes of routes, a module each; terrain_forge.paths.spec finds them."""
