"""Where rocks lie: densities, draws addressed by cell, disks that do not overlap."""
