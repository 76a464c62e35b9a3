"""From anybody's traces to those that can be used, and why the others cannot."""
