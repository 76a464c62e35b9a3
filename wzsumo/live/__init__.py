"""A map that lives: one more trace turns it into the next, and it notices what changed."""
