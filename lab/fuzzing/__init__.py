"""Search for defects with random and mutated records."""
