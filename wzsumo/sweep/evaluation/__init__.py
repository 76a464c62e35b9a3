"""The part of a sweep that decides its rows: the names of the cases, and which simulations, maps and evaluations they share."""
