"""The road before a zone, from what people have: a SUMO network, a line with attributes."""
