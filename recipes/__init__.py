"""Ready worlds, each buildable as it stands; a package so that they travel in the wheel."""
