"""The ground that a zone closes, kept clear of the vehicles beside it."""
