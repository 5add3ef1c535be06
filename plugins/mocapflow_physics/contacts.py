"""Where cloth is near the body: a plane of contact per particle, from the distance fields of its parts (numba)."""

from __future__ import annotations

import math

import numba
from mocapflow_draping.distance import body_distance

STEP = 0.004  # m, of the differences that give the direction away from the body


@numba.njit(cache=True, error_model="numpy")
def find_contacts(cloth, moved, skin, reach, bodies, solid, particle, place, normal):  # type: ignore[no-untyped-def]
    """Write the contacts of B cloths and return how many there are.

    Args:
        cloth: (B, W, 3) m.
        moved: (W,) booleans: particles that are not pinned.
        skin: (B,) m, contact distance.
        reach: m, nearer than this a particle has a contact.
        bodies: voxel_from_world (B, P, 3, 4), stretch (B, P) and ball centres (B, P, 3) of the parts.
        solid: radius, shape, offset, values, 1/voxel and margin of the parts.
        particle: (M,) written: b W + w.
        place: (M, 3) m, written: the point of the plane nearest to the particle.
        normal: (M, 3), written: away from the body.
    """
    maps, stretch, centres = bodies
    found = 0
    for b in range(len(cloth)):
        near = 0
        m, s, c = maps[b], stretch[b], centres[b]
        for w in range(cloth.shape[1]):
            if not moved[w]:
                continue
            x, y, z = cloth[b, w, 0], cloth[b, w, 1], cloth[b, w, 2]
            away, near = body_distance(x, y, z, m, s, c, solid, near)
            if away >= reach:
                continue
            gx = _rise(x, y, z, STEP, 0.0, 0.0, m, s, c, solid, near)
            gy = _rise(x, y, z, 0.0, STEP, 0.0, m, s, c, solid, near)
            gz = _rise(x, y, z, 0.0, 0.0, STEP, m, s, c, solid, near)
            steep = math.sqrt(gx * gx + gy * gy + gz * gz)
            if steep == 0.0:
                continue
            nx, ny, nz = gx / steep, gy / steep, gz / steep
            depth = away - skin[b]
            particle[found] = b * cloth.shape[1] + w
            normal[found, 0], normal[found, 1], normal[found, 2] = nx, ny, nz
            place[found, 0], place[found, 1], place[found, 2] = x - depth * nx, y - depth * ny, z - depth * nz
            found += 1
    return found


@numba.njit(cache=True, error_model="numpy")
def _rise(x, y, z, dx, dy, dz, maps, stretch, centres, solid, near):  # type: ignore[no-untyped-def]
    """Return how much farther from the body it is on one side of a point than on the other."""
    ahead = body_distance(x + dx, y + dy, z + dz, maps, stretch, centres, solid, near)[0]
    return ahead - body_distance(x - dx, y - dy, z - dz, maps, stretch, centres, solid, near)[0]
