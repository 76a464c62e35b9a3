"""Studies: their cases, the workers that run them, the store of results, the statistics."""
