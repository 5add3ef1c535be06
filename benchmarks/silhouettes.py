"""Silhouette and occluding contour of the demo body at 640 x 800, against filling its triangles one by one.

Run `OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/silhouettes.py`. CPU ms of one core for a view, the
least and the median over repeats; ratios are of medians within the run. The alternatives make a mask alone, from
vertices that are projected already.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from inspect import unwrap

import cv2
import numpy as np
from mocapflow_bodies.scanned import Scanned

from mocapflow.assets import Camera
from mocapflow.data import CLOTH, NO_CLOTH, Surface
from mocapflow.geometry import meshes, silhouettes, span_kernels
from mocapflow.geometry import silhouette_kernels as kernels
from mocapflow.geometry.cameras import projection
from mocapflow.help.shipped import shipped
from mocapflow.io.cameras.calibration import read_cameras
from mocapflow.io.subject.first_pose import read_pose
from mocapflow.scene import Scene

CLIP = shipped("examples", "data", "skirt_steps")
SIZE = np.array([640, 800])  # px
SPACING, BAND = 4.0, 8.0  # px, as in tracking
occluding_edges = unwrap(silhouettes._occluding_edges)  # which are otherwise computed once for a surface


def at_full_size(camera: Camera) -> Camera:
    """The same view on an image of 640 x 800 px: the longer side decides, the middle stays in the middle."""
    factor = (SIZE / camera.size).min()
    intrinsics = camera.intrinsics.copy()
    intrinsics[:2] *= factor
    intrinsics[:2, 2] += (SIZE - factor * camera.size) / 2
    return replace(camera, size=SIZE.astype(np.int32), intrinsics=intrinsics)


def filled_one_by_one(corners: np.ndarray) -> np.ndarray:
    mask = np.zeros(SIZE[::-1], np.uint8)
    for corner in corners:
        cv2.fillConvexPoly(mask, corner, 1, cv2.LINE_8, 4)
    return mask > 0


def filled_at_once(corners: np.ndarray) -> np.ndarray:
    mask = np.zeros(SIZE[::-1], np.uint8)
    cv2.drawContours(mask, corners, -1, 1, cv2.FILLED)
    return mask > 0


def cpu_ms(actions: list[Callable[[], object]], repeats: int) -> tuple[float, float]:
    """Least and median CPU ms of an action, over repeats of all views."""
    for action in actions:
        action()
    samples = []
    for _ in range(repeats):
        begin = time.process_time()
        for action in actions:
            action()
        samples.append((time.process_time() - begin) * 1e3 / len(actions))
    return min(samples), float(np.median(samples))


def steps_of(surface: Surface, camera: Camera) -> dict[str, Callable[[], object]]:
    """The whole, its parts, and the alternatives for one view."""
    pixels, depth = np.empty((len(surface.vertices), 2)), np.empty(len(surface.vertices))
    facing, matrix = np.empty(len(surface.faces), np.int8), projection(camera)
    kernels.project(surface.vertices, matrix, pixels, depth)
    kernels.face_directions(pixels, surface.faces, facing)
    cloth = surface.layer == CLOTH
    segments, times = kernels.occluding_edges(surface.edges, facing, cloth)
    ends, boundary = pixels[segments], silhouettes.outline(surface, camera)
    crossings = span_kernels.crossings(ends, camera.size)
    covered = span_kernels.covered(*crossings, times, camera.size[0])
    fine = np.round(pixels[surface.faces] * 16).astype(np.int32)
    coarse = np.round(pixels[surface.faces]).astype(np.int32)[:, :, None]
    return {
        "mask and contour": lambda: both(surface, camera),
        "  project": lambda: kernels.project(surface.vertices, matrix, pixels, depth),
        "  faces towards the camera": lambda: kernels.face_directions(pixels, surface.faces, facing),
        "  occluding edges": lambda: kernels.occluding_edges(surface.edges, facing, cloth),
        "  where they cross the rows": lambda: span_kernels.crossings(ends, camera.size),
        "  what they cover": lambda: span_kernels.covered(*crossings, times, camera.size[0]),
        "  where that ends": lambda: kernels.boundary(ends, times, *covered, silhouettes.PIECE),
        "  outline, all of the above": lambda: outline(surface, camera),
        "  contour samples": lambda: silhouettes.samples(boundary, surface, camera, SPACING),
        "vertex normals, once for all views": lambda: meshes.vertex_normals(surface.vertices, surface.faces),
        "signed distance": lambda: silhouettes.signed_distance(boundary, camera, BAND),
        "fillConvexPoly, each triangle": lambda: filled_one_by_one(fine),
        "drawContours, all triangles": lambda: filled_at_once(list(coarse)),
    }


def outline(surface: Surface, camera: Camera) -> silhouettes.Outline:
    return silhouettes._bounded(occluding_edges(surface, camera), camera)


def both(surface: Surface, camera: Camera) -> object:
    boundary = outline(surface, camera)
    return silhouettes.covered(surface, camera), silhouettes.samples(boundary, surface, camera, SPACING)


def main() -> None:
    body = Scanned().load(CLIP)
    cameras = tuple(at_full_size(camera) for camera in read_cameras(CLIP))
    surface = Scene(cameras=cameras, body=body).surface(read_pose(CLIP / "init.json", body), NO_CLOTH)
    views = [steps_of(surface, camera) for camera in cameras]
    print(f"{len(body.vertices)} vertices, {len(body.faces)} triangles, {len(cameras)} views of {SIZE[0]} x {SIZE[1]}")
    masks = [np.asarray(both(surface, camera)[0]) for camera in cameras]
    print(f"mask {np.mean([mask.sum() for mask in masks]):.0f} px, contour "
          f"{np.mean([len(both(surface, camera)[1].vertex) for camera in cameras]):.0f} points")  # fmt: skip
    filled = [view["fillConvexPoly, each triangle"]() for view in views]
    print(f"overlap with filled triangles {np.mean([overlap(*pair) for pair in zip(masks, filled, strict=True)]):.4f}")
    ours = 0.0
    print(f"{'':34}{'least ms':>10}{'median ms':>11}{'ratio':>9}")
    for name in views[0]:
        slow = "triangle" in name
        least, median = cpu_ms([view[name] for view in views], 15 if slow else 200)
        ours = ours or median
        print(f"{name:34}{least:10.3f}{median:11.3f}{median / ours:9.2f}")


def overlap(one: np.ndarray, other: object) -> float:
    return silhouettes.intersection_over_union(one, np.asarray(other))


if __name__ == "__main__":
    main()
