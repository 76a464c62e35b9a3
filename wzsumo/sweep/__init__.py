"""Studies: their cases, the workers that carry them out, the store, the summary."""
