"""Ready studies of the recipes beside; a package so that they travel in the wheel."""
