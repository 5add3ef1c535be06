"""Videos and folders of images: their pictures, frame by frame, and what they have to agree on."""
