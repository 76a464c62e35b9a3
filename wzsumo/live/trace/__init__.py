"""What one trace says: its cells, the ways that can have made it, its steps, how it used the lanes."""
