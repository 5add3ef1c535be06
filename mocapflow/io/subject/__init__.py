"""The files of a person: mesh, skeleton and skin weights of a scan, and the first pose."""
