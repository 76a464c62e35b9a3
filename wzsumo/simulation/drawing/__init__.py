"""What sumo-gui shows of a zone: areas, devices, signs and the view that it opens with."""
