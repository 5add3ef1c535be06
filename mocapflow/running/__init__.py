"""A run: stages wired, their recipes, what is made and what is taken from the store, what is told."""
