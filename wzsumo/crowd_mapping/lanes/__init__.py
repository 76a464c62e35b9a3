"""The generative model of lanes: what vehicles drove in which lane, where lanes lie, and where they are closed."""
