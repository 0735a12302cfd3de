"""The ground beyond a site, out to the horizon."""
