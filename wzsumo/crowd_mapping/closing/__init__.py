"""Where lanes close: who used them, where they end, the line of the taper, the map of before."""
