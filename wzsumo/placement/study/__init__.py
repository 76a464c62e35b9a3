"""What a study needs of a placed zone: its road in SUMO's edges, its times, and the configurations with and without it."""
