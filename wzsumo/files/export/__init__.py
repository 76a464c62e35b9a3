"""Lanes for other people's tools: what of a lane map is open, as Lanelet2, OpenDRIVE and GeoParquet."""
