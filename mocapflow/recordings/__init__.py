"""Recordings: read, examined, and what cameras agree on."""
