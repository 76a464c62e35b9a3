"""Nouns -> numbers."""
