"""Rover descriptions as data, one for every simulator."""
