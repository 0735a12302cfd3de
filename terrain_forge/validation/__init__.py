"""Checks of a built world by the consumers of its files, and the report of them."""
