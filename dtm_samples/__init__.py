"""Small DTMs of the recipes; a package so that they travel in the wheel."""
