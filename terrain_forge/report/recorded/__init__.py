"""What the page shows of a recording: a film, a sweep, plots, figures."""
