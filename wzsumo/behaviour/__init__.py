"""How the ego heeds others: which vehicle it follows, where it gives way, where it stops, and what acceleration that leaves."""
