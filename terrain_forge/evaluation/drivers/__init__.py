"""Small programs that lead a recording through a system, each run by that system's own Python."""
