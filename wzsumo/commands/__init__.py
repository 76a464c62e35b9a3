"""The commands of the command line, one module per command; what they say while they work, and their figures in words."""
