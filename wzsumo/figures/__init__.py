"""Figures of a zone, its maps, its drives and its traffic, and of a study."""
