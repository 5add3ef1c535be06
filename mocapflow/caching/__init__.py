"""What cache keys are made of: digests of code and of files, and the keys."""
