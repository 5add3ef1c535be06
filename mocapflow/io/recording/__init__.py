"""The folder of a recording: where its parts lie, keypoints, clean plates and occluders."""
