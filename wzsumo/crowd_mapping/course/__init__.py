"""The course that all traces share along the road, and the lane that each kept."""
