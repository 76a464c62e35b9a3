"""Lane hypotheses: patterns of lanes, closures and their ends, and how well the traces agree with each."""
