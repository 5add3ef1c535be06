"""Every type that travels between the steps of a frame; `assets` has what stays, `results` what comes out.

Conventions, everywhere: SI units inside, pixels for images, radians; world right-handed, z up; images indexed
[row = y, column = x] with pixel centres on integers; transforms read `a_from_b`; column vectors, active
transforms; twists are (omega, v). Lens distortion is removed when a frame is decoded, so every `Frame` and the
cameras of a `Scene` are pinhole. Pose increments (omega, v) are left-multiplied, in the world frame.

Axis names: C cameras, V body vertices, F faces, J joints, D screws (the angles), W cloth vertices, Q cloth
parameters, M matches, T frames, S = 6 + D + Q unknowns of a frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from functools import cached_property

import numpy as np

from mocapflow.records import F32, F64, I16, I32, U8, Bool, array, record

BODY, CLOTH = 0, 1  # values of Surface.layer
UNKNOWN = np.pi**2  # rad^2 and m^2, the variance where nothing was seen
REMEMBERED = 3  # frames that later ones may know: a pose, its velocity, its acceleration
LAYERS = ("person", "garment", "skin")  # values of Silhouette.layer
BORDER = 3  # px along the image border where a silhouette is cut, not occluding


@record
class Flow:
    """Points tracked from the previous frame into this one, in one view."""

    pixel: F32 = array("P", 2, unit="px, in the previous frame")
    displacement: F32 = array("P", 2, unit="px")


@record
class Frame:
    """One moment, seen by every camera."""

    index: int
    time: float  # s
    images: tuple[U8, ...]  # C x (H, W, 3) BGR, undistorted
    usable: Bool = array("C", unit="False: lost or corrupted view")
    reasons: tuple[str, ...] = ()  # why a view is not usable, "" where it is; empty: all usable
    hidden: tuple[Bool, ...] = ()  # C x (H, W) True where a picture shows nothing of the scene; empty: nowhere
    flow: tuple[Flow, ...] | None = None  # from the previous frame, C x
    keypoints: tuple[F64, ...] | None = None  # C x (N people, K, 3) px, px, confidence; undistorted

    def hidden_in(self, camera: int) -> Bool | None:
        """Return the mask (H, W) of where a view shows nothing of the scene; None: nothing is hidden."""
        return self.hidden[camera] if self.hidden else None


@record
class Pose:
    """Root transform and joint angles of one moment."""

    root: F64 = array(4, 4, unit="m, world_from_body")
    angles: F64 = array("D", unit="rad")


@record
class PoseBatch:
    """B poses of one body."""

    root: F64 = array("B", 4, 4, unit="m, world_from_body")
    angles: F64 = array("B", "D", unit="rad")


@record
class Cloth:
    """The draped garment and the parameters (with forces) that draped it; empty without a garment."""

    vertices: F64 = array("W", 3, unit="m, world")
    parameters: F64 = array("Q", unit="by name, see GarmentMesh.parameter_names")


NO_CLOTH = Cloth(vertices=np.empty((0, 3)), parameters=np.empty(0))


@record
class Surface:
    """Posed triangle mesh in world coordinates: body vertices first, then cloth.

    `joints` and `screws` say how body vertices move: the skin of joint j moves with `joints[j]`, and a unit
    change of angle d moves everything below its joint by the world twist `screws[d]`.
    """

    vertices: F64 = array("N", 3, unit="m")
    faces: I32 = array("F", 3, unit="vertex index")
    edges: I32 = array("E", 4, unit="two vertices, then the faces left and right of the way between them, or -1")
    layer: U8 = array("N", unit="0 body, 1 cloth")
    joints: F64 = array("J", 4, 4, unit="m, world_from_rest")
    screws: F64 = array("D", 6, unit="twist (omega, v) in the world")

    @cached_property
    def cloth(self) -> Bool:
        """Which vertices (N,) are cloth."""
        return np.asarray(self.layer == CLOTH)

    @cached_property
    def normals(self) -> F64:
        """Unit vertex normals (N, 3)."""
        from mocapflow.geometry.meshes import vertex_normals  # compiled code, loaded where it is used

        return vertex_normals(self.vertices, self.faces)


@record
class Contour:
    """The occluding contour of a surface in one view: evenly spaced points on the boundary of its silhouette, by row.

    A point lies on an edge of the mesh; `vertex` is the nearer end of that edge and `anchor` where it projects.
    """

    vertex: I32 = array("K", unit="surface vertex index")
    anchor: F64 = array("K", 2, unit="px, image of the vertex")
    pixel: F64 = array("K", 2, unit="px")
    normal: F64 = array("K", 2, unit="1, unit, out of the silhouette")


@record
class Silhouette:
    """A signed distance to the outline in one view, positive inside, clipped to a band; mask = distance > 0."""

    camera: int
    layer: str  # one of LAYERS
    distance: F32 = array("H", "W", unit="px")

    @cached_property
    def zero_level(self) -> tuple[F64, F64]:
        """The image contour: pixels (K, 2) sorted by row, and unit normals (K, 2) out of the silhouette."""
        from mocapflow.geometry.contours import zero_crossings  # compiled code, loaded where it is used

        return zero_crossings(self.distance, BORDER)


@record
class Matches:
    """Image points paired with surface vertices.

    Where `direction` is a unit vector, only the distance along it counts (a point on a contour may slide along
    the contour); where it is zero, the full displacement counts.
    """

    camera: I16 = array("M", unit="camera index")
    pixel: F64 = array("M", 2, unit="px, undistorted")
    direction: F64 = array("M", 2, unit="1")
    vertex: I32 = array("M", unit="surface vertex index")
    weight: F64 = array("M", unit="px^-2, one over the variance, robust factor included")


@record
class Segmentation:
    """The silhouettes of one frame, one per usable view and layer, what is found inside them, and what they cost."""

    silhouettes: tuple[Silhouette, ...]
    inner: Matches | None = None  # contours of parts before others, with the vertices whose edges they are
    energies: Mapping[str, float] = field(default_factory=dict)  # "cam01.data": by view and term of `functional`
    appearance: Mapping[str, F64] = field(default_factory=dict)  # region statistics for the next frame

    def of(self, layer: str) -> list[Silhouette]:
        """Return the silhouettes of one layer."""
        return [silhouette for silhouette in self.silhouettes if silhouette.layer == layer]


@record
class Residual:
    """What a prior adds to the pose equations; the columns are (omega, v, angles) and, if wider, cloth."""

    error: F64 = array("K", unit="1, whitened")
    jacobian: F64 = array("K", "S", unit="1 per m, rad or parameter")
    energy: float  # what accept or reject compares: half the squared error, or -log p


@record
class Estimate:
    """Pose and cloth parameters with their covariance; increments as everywhere."""

    pose: Pose
    parameters: F64 = array("Q", unit="by name")
    covariance: F64 = array("S", "S", unit="of (omega, v, angles, parameters)")
    observed: F64 = array("D", unit="1, share of the priors' variance of each angle that the images took away")
    matches: Matches | None = None  # what its last step explains; None: the solver does not say


def unseen(observed: F64) -> Bool:
    """Return True where the priors decided an angle: the images took away less than half of its variance."""
    return np.asarray(observed < 0.5)  # False where it is not known (NaN)


def blind(observed: F64) -> bool:
    """Return True where the images told of no angle at all: a lost frame, or one that shows nobody."""
    return len(observed) > 0 and bool(unseen(observed).all())


@record
class FrameState:
    """One turn of the loop: what is known of a frame so far."""

    estimate: Estimate
    cloth: Cloth
    segmentation: Segmentation
    matches: Matches


@record
class Change:
    """How far one turn moved the solution."""

    body: float  # m, largest move of a body vertex
    cloth: float  # m, root mean square move of the cloth: a fold may flip while all the rest hangs still
    angles: float  # rad, largest change of a joint angle
    sigmas: float  # standard deviations of the pose, root mean square over its independent directions
    shift: F64 | None = array("N", 3, unit="m, of each vertex of the surface; None: not known", default=None)


@record
class Turn:
    """Where the loop stands: schedules (coarse to fine, shares) read it."""

    index: int
    change: Change | None = None
    far: bool = False  # the frame began far from the person: a first one, or one whose first turn moved the body far

    def calm(self, body_mm: float) -> bool:
        """True where the turn before moved the body by less; the first turn never is."""
        return self.change is not None and self.change.body < body_mm / 1000


@record
class FrameResult:
    """What the loop hands over for one frame."""

    state: FrameState
    iterations: int
    steady: bool
    oscillating: bool
    change: Change
    overlap: F64 = array("C", unit="1, intersection over union of model and image silhouette; NaN where unseen")
    energy: F64 = array("U", "E", unit="terms of the functional after each of at most U turns; NaN where there is none")
    energy_terms: tuple[str, ...]  # their E names
    notes: tuple[str, ...] = ()  # what a user should know of the frame
    doubted: bool = False  # the images contradict it, and nothing better was found
    seconds: Mapping[str, float] = field(default_factory=dict)  # CPU time of each step; never part of a result


@record
class Moment:
    """A committed frame, as later frames may know it."""

    time: float  # s
    pose: Pose
    cloth: Cloth
    observed: F64 | None = array("D", unit="1, as in Estimate; None: not known", default=None)

    @property
    def blind(self) -> bool:
        """True where the images told of no angle; False where that is not known."""
        return self.observed is not None and blind(self.observed)


@record
class Past:
    """Everything a frame may know of earlier frames: the last three, latest last, and the last appearance."""

    moments: tuple[Moment, ...] = ()
    appearance: Mapping[str, F64] = field(default_factory=dict)
    after_gap: bool = False  # there were frames, and the last do not show the person

    def after(self, moment: Moment, appearance: Mapping[str, F64]) -> Past:
        """Return the past one frame later."""
        return Past(moments=(*self.moments, moment)[-REMEMBERED:], appearance=appearance)

    def trusted(self) -> Past:
        """Return the past, without moments where the last two do not show the person: the next begins like a first."""
        blind = bool(self.moments) and all(moment.blind for moment in self.moments[-2:])
        return Past(appearance=self.appearance, after_gap=True) if blind else self


@record
class Start:
    """Pose and cloth parameters of the first frame."""

    pose: Pose
    parameters: F64 = array("Q", unit="by name")
    others: tuple[Pose, ...] = ()  # that may be right as well: the track begins from the one it fits best


def empty_matches() -> Matches:
    """Return matches without any pair."""
    pixels = np.empty((0, 2))
    return Matches(
        camera=np.empty(0, np.int16),
        pixel=pixels,
        direction=pixels.copy(),
        vertex=np.empty(0, np.int32),
        weight=np.empty(0),
    )
