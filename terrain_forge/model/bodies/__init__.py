"""The bodies that we know, a module each; terrain_forge.model.known_bodies lists them."""
