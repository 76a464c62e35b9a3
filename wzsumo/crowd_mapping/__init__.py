"""Traces -> OccupancyGrid."""
