"""A work zone placed in an existing SUMO network: the network patched, the demand and its detectors kept."""
