"""The scenario of one case: the sections of its file, the site that they make, the road before the zone."""
