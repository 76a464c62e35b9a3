"""Drawings of a zone, its maps, its traffic and of a study."""
