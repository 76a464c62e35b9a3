"""Where lanes close: the taper's line, the ends of lanes, the use of lanes that go through, and the road before the zone."""
