"""How the ego minds others: whom it follows, where it gives way and where it stops."""
