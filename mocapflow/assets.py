"""What stays the same over a recording: cameras, the body, the garment, the empty scene."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from mocapflow.errors import GarmentError, MocapflowError, ShapeError, alternatives
from mocapflow.records import F32, F64, I32, U8, Bool, array, arrays, out_of_range, record


@record
class Camera:
    """A calibrated camera; distortion is OpenCV's k1 k2 p1 p2 k3 (fisheye: k1 k2 k3 k4 0)."""

    name: str
    size: I32 = array(2, unit="px, width and height")
    intrinsics: F64 = array(3, 3, unit="px")
    distortion: F64 = array(5, unit="1")
    camera_from_world: F64 = array(4, 4, unit="m")
    fisheye: bool = False


@record
class Rig:
    """The pinhole cameras of a scene, where a stage has corrected them."""

    cameras: tuple[Camera, ...]


@record
class Body:
    """A body at rest: triangle mesh, kinematic chain of zero-pitch screws, linear blend skinning.

    Joints are ordered parents first and the screws of a joint stand together, in the order of the joints.
    """

    vertices: F64 = array("V", 3, unit="m, at rest")
    faces: I32 = array("F", 3, unit="vertex index, outward by the right hand")
    joint_names: tuple[str, ...]
    parents: I32 = array("J", unit="joint index, -1 for the root")
    positions: F64 = array("J", 3, unit="m, at rest")
    screw_names: tuple[str, ...]  # e.g. knee_l.flexion
    twists: F64 = array("D", 6, unit="unit twists (omega, v) at rest")
    screw_joint: I32 = array("D", unit="joint index")
    limits: F64 = array("D", 2, unit="rad")
    rest_spread: F64 = array("D", unit="rad, standard deviation about zero; inf where free")
    skin_joint: I32 = array("V", 5, unit="joint index")
    skin_weight: F64 = array("V", 5, unit="1, rows sum to one")
    cut: Bool = array("V", unit="True on the rim where a partial body was cut off")
    morph_offset: F64 | None = array("V", 3, unit="m, added at rest in full where the morph is complete", default=None)
    morph_screw: int = -1  # the angle that drives the morph
    morph_range: tuple[float, float] = (0.0, 1.0)  # rad, where the morph begins and where it is complete
    shape_modes: F64 | None = array("M", "V", 3, unit="m a standard deviation: how people differ at rest", default=None)
    joint_modes: F64 | None = array("M", "J", 3, unit="m a standard deviation, of the joints with them", default=None)

    def __post_init__(self) -> None:
        """Refuse what points beyond the body: kernels look up unchecked.

        Raises:
            ShapeError: an index is not that of a vertex, joint or screw, joints or screws are out of order, or modes
                lack those of the joints.
        """
        if (odd := out_of_range(self.faces, len(self.vertices))) is not None:
            raise ShapeError(f"Body: a face names vertex {odd} of {len(self.vertices)}")
        count = len(self.parents)
        skin, screws, parents = (self.skin_joint, 0), (self.screw_joint, 0), (self.parents, -1)
        for what, (index, least) in {"the skin": skin, "a screw": screws, "a parent": parents}.items():
            if (odd := out_of_range(index, count, least)) is not None:
                raise ShapeError(f"Body: {what} names joint {odd} of {count}")
        if (self.parents >= np.arange(count)).any() or (np.diff(self.screw_joint) < 0).any():
            raise ShapeError("Body: parents have to stand before their children, and screws in the order of the joints")
        start, stop = self.morph_range
        if self.morph_offset is not None and (start == stop or not 0 <= self.morph_screw < len(self.twists)):
            raise ShapeError("Body: its morph is driven by no angle, or over no range")
        if (self.shape_modes is None) != (self.joint_modes is None):
            raise ShapeError("Body: modes of its shape move the joints, too: give both or none")

    @cached_property
    def main_joint(self) -> I32:
        """The joint (V,) that moves most of each vertex."""
        joint: I32 = self.skin_joint[np.arange(len(self.vertices)), self.skin_weight.argmax(axis=1)]
        return joint

    def joint(self, name: str) -> int:
        """Return the index of a joint by name.

        Raises:
            MocapflowError: there is no such joint.
        """
        if name not in self.joint_names:
            raise MocapflowError(f"the body has no joint '{name}'", hint=alternatives(name, self.joint_names))
        return self.joint_names.index(name)


@record
class GarmentMesh:
    """A garment at rest on the rest body."""

    name: str
    vertices: F64 = array("W", 3, unit="m, at rest")
    faces: I32 = array("G", 3, unit="vertex index")
    strands: I32 = array("N", "L", unit="vertex index from the pinned end, -1 padded")
    rings: I32 = array("E", 2, unit="vertex index: links around the garment")
    ring_length: F64 = array("E", unit="m, rest length of each link")
    carried_by: I32 = array("W", unit="joint that moves the vertex before the drape")
    pinned: I32 = array("P", unit="vertex index")
    pinned_to: I32 = array("P", unit="body vertex index")
    parameter_names: tuple[str, ...]
    parameter_bounds: F64 = array("Q", 2, unit="unit of the parameter")
    repairs: tuple[str, ...] = ()  # tape measures that were changed so that it could be sewn; also in run.json
    pieces: tuple[GarmentMesh, ...] = ()  # where several garments are worn as one: each of them, in this order

    def __post_init__(self) -> None:
        """Refuse what no draper could lay.

        Raises:
            GarmentError: a vertex is not finite or not there, or a link has no length.
        """
        count = len(self.vertices)
        face, strand, ring, pin = (self.faces, 0), (self.strands, -1), (self.rings, 0), (self.pinned, 0)
        for what, (index, least) in {"face": face, "strand": strand, "ring": ring, "pin": pin}.items():
            if (odd := out_of_range(index, count, least)) is not None:
                raise GarmentError(f"{self.name}: a {what} names vertex {odd} of {count}")
        if not np.isfinite(self.vertices).all():
            first = int(np.argwhere(~np.isfinite(self.vertices))[0, 0])
            raise GarmentError(f"{self.name}: vertex {first} is not finite", hint="check the tape measures")
        links = np.linalg.norm(np.diff(self.vertices[self.strands], axis=1), axis=2)
        short = np.argwhere((links <= 0) & (self.strands[:, 1:] >= 0))
        if len(short):
            hint = "each vertex of a strand must lie below the one before it"
            raise GarmentError(f"{self.name}: strand {short[0, 0]} has a link of zero length", hint=hint)
        if not (self.ring_length > 0).all():
            raise GarmentError(f"{self.name}: ring link {int((self.ring_length > 0).argmin())} has no length")

    def columns(self, *meanings: str) -> list[int]:
        """Return which parameters (of Q) have one of these meanings; that of `skirt.take_up` is `take_up`."""
        return [k for k, name in enumerate(self.parameter_names) if name.rpartition(".")[2] in meanings]


@record
class Background:
    """The empty scene, per camera: mean and spread of every pixel."""

    mean: tuple[F32, ...] = arrays("H", "W", "BGR", unit="grey levels")
    spread: tuple[F32, ...] = arrays("H", "W", "BGR", unit="grey levels, standard deviation; inf where nobody knows")
    floor_m: float | None = None  # height of the floor, where shadows have told it
    turned_px: tuple[float, ...] = ()  # by camera, since its plate was taken and before it was moved; empty: none had

    @cached_property
    def known(self) -> tuple[Bool, ...]:
        """Where it is known what a view shows without the person: (H, W) each."""
        return tuple(np.asarray(np.isfinite(spread).all(axis=2)) for spread in self.spread)

    @cached_property
    def pictures(self) -> tuple[U8, ...]:
        """What a view shows without the person: (H, W, 3) each."""
        return tuple(np.clip(np.rint(mean), 0, 255).astype(np.uint8) for mean in self.mean)
