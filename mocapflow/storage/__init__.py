"""What is kept on disk: the store, its locks and copies, and a track that grows frame by frame."""
