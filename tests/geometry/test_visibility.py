"""What is seen at a pixel, against rays cast at every triangle."""

from dataclasses import replace

import numpy as np

from mocapflow.data import CLOTH, NO_CLOTH
from mocapflow.geometry.cameras import centre, project
from mocapflow.geometry.visibility import front_vertices
from mocapflow.testing import tiny_cloth, tiny_pose, tiny_scene

SCENE = tiny_scene(clothed=True)


def cast(surface, camera, points):
    """The foremost triangle (P,) on the ray through each point, -1 for none."""
    origin = centre(camera)
    rays = np.linalg.solve(camera.intrinsics, np.column_stack([points, np.ones(len(points))]).T).T
    rays = rays @ camera.camera_from_world[:3, :3]
    a, b, c = np.moveaxis(surface.vertices[surface.faces], 1, 0)
    best, found = np.full(len(points), np.inf), np.full(len(points), -1)
    for f in range(len(surface.faces)):
        matrix = np.column_stack([b[f] - a[f], c[f] - a[f]])
        for p, ray in enumerate(rays):
            try:
                u, v, t = np.linalg.solve(np.column_stack([matrix, -ray]), origin - a[f])
            except np.linalg.LinAlgError:
                continue
            if min(u, v, 1 - u - v) >= 0 and 0 < t < best[p]:
                best[p], found[p] = t, f
    return found


def test_the_foremost_triangle_is_found():
    pose = tiny_pose(SCENE)
    surface, camera = SCENE.surface(pose, tiny_cloth(SCENE, pose)), SCENE.cameras[0]
    image = project(surface.vertices, camera)
    low, high = image.min(axis=0) - 5, image.max(axis=0) + 5
    points = np.random.default_rng(0).uniform(low, high, (40, 2))
    points[0] = points[1]  # two points in one pixel
    vertex, projected = front_vertices(surface, camera, points)
    face = cast(surface, camera, points)
    np.testing.assert_allclose(projected, image, atol=1e-9)
    np.testing.assert_array_equal(vertex >= 0, face >= 0)
    assert 8 < (vertex >= 0).sum() < 40
    hit = vertex >= 0
    corners = surface.faces[face[hit]]
    shares = [  # of each corner in the point, on the picture
        np.linalg.solve(np.vstack([image[each].T, np.ones(3)]), [*point, 1.0])
        for each, point in zip(corners, points[hit], strict=True)
    ]
    nearest = np.take_along_axis(corners, np.argmax(shares, axis=1)[:, None], axis=1)[:, 0]
    np.testing.assert_array_equal(vertex[hit], nearest)


def test_skin_is_seen_from_outside_alone_and_cloth_from_both_sides():
    pose = tiny_pose(SCENE)
    body, camera = SCENE.undressed.surface(pose, NO_CLOTH), SCENE.cameras[0]
    image = project(body.vertices, camera)
    points = np.random.default_rng(1).uniform(image.min(axis=0), image.max(axis=0), (200, 2))
    inside_out = replace(body, faces=np.ascontiguousarray(body.faces[:, ::-1]))
    outside, inside = (front_vertices(surface, camera, points)[0] for surface in (body, inside_out))
    hit = (outside >= 0) & (inside >= 0)
    depth = body.vertices @ camera.camera_from_world[2, :3]
    assert hit.sum() > 20 and (depth[inside[hit]] > depth[outside[hit]] - 0.01).all()  # the far wall, from within
    assert np.median(depth[inside[hit]] - depth[outside[hit]]) > 0.05
    worn = (replace(surface, layer=np.full(len(depth), CLOTH, np.uint8)) for surface in (body, inside_out))
    np.testing.assert_array_equal(*(front_vertices(surface, camera, points)[0] for surface in worn))


def test_no_points_and_points_beside_the_surface():
    surface = SCENE.surface(tiny_pose(SCENE), tiny_cloth(SCENE, tiny_pose(SCENE)))
    assert len(front_vertices(surface, SCENE.cameras[0], np.empty((0, 2)))[0]) == 0
    assert (front_vertices(surface, SCENE.cameras[0], np.array([[0.2, 0.4], [319.0, 3.0]]))[0] == -1).all()
