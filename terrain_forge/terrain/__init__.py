"""The ground: the DTM on the site's lattice, the layers that are added to it, its colours."""
