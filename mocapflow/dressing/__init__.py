"""What makes the clothed model: a body, the garment sewn on it, and how that hangs."""
