"""Shared geometry: twists, Plücker lines, cameras, the kinematic chain, meshes, silhouettes."""
