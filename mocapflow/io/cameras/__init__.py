"""Cameras: their calibration files, whether they make sense, and the views that the steps get of them."""
