"""What a spec file says of one case: its sections, the site that they make, the road before the zone."""
