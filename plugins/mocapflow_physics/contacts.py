"""Where cloth is near the body: a plane of contact per particle, from the distance fields of its parts (numba)."""

from __future__ import annotations

import numba
from mocapflow_draping.distance import body_distance, outwards


@numba.njit(cache=True, error_model="numpy")
def find_contacts(cloth, moved, skin, reach, parts, values, particle, place, normal):  # type: ignore[no-untyped-def]
    """Write the contacts of B cloths and return how many there are.

    Args:
        cloth: (B, W, 3) m.
        moved: (W,) booleans: particles that are not pinned.
        skin: (B,) m, contact distance.
        reach: m, nearer than this a particle has a contact.
        parts: (B, P, COLUMNS), the bodies, see `parts`.
        values: their voxels.
        particle: (M,) written: b W + w.
        place: (M, 3) m, written: the point of the plane nearest to the particle.
        normal: (M, 3), written: away from the body.
    """
    found = 0
    for b in range(len(cloth)):
        near = 0
        for w in range(cloth.shape[1]):
            if not moved[w]:
                continue
            x, y, z = cloth[b, w, 0], cloth[b, w, 1], cloth[b, w, 2]
            away, near = body_distance(x, y, z, near, parts[b], values)
            if away >= reach:
                continue
            nx, ny, nz = outwards(x, y, z, near, parts[b], values)
            depth = away - skin[b]
            particle[found] = b * cloth.shape[1] + w
            normal[found, 0], normal[found, 1], normal[found, 2] = nx, ny, nz
            place[found, 0], place[found, 1], place[found, 2] = x - depth * nx, y - depth * ny, z - depth * nz
            found += 1
    return found
