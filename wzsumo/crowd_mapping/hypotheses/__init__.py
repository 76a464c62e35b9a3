"""Which lanes there may be: patterns, closures and what the traces say of each."""
