"""Work Zone Data Exchange (WZDx) feeds: what they announce, and feeds of what a map verified."""
