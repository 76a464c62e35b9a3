"""Traces as they come, and the folder that a live map is kept in."""
