"""What decides the rows of a study: the names of its cases, and how cases share simulations, maps and evaluations."""
