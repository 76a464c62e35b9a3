"""A zone that changes while the ego approaches: the traces before and after, and what a live map makes of them."""
