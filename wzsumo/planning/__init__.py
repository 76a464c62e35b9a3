"""OccupancyGrid -> ReferencePath."""
