"""The ground: the DTM on the site's lattice and the layers that are added to it, and its colours."""
