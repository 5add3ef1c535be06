"""Motion over time, of joints and markers: csv tables, OpenSim's TRC and MOT, and C3D."""
