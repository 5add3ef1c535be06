"""Two rigs that saw one person: how they lie to each other, and how far apart the joint centres are."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from mocapflow_export import layout, tables

from mocapflow.geometry.registration import Registration
from mocapflow.io.motion.opensim_axes import opensim_from_world
from mocapflow.io.motion.trc import write_trc
from mocapflow.records import F64, array, record
from mocapflow_evaluation import compare, comparison_plots, stick
from mocapflow_evaluation.alignment import clocks, resampled
from mocapflow_evaluation.references import Reference
from mocapflow_evaluation.stick import Stick
from mocapflow_evaluation.tracked_motion import TrackedMotion

COMMON_POINTS = "registration.csv"  # beside the reference: points that both rigs have measured
ODD = 0.002  # of scale: calibrations are better than that


@record
class Rigs:
    """What was found; without joint centres in the reference there is nothing."""

    ours: Stick
    frame: F64 = array("T", unit="frame index in the videos")
    theirs: Stick | None = None  # in our world, at our frames
    aligned: Stick | None = None  # the same without the lag between both
    figures: Mapping[str, Any] | None = None
    notes: tuple[str, ...] = ()

    def write(self, folder: Path, frame_rate: float, start: float) -> list[Path]:
        """Write the distances, the stick model as a .trc and as a picture into a run folder; return the pictures.

        Args:
            folder: the run folder.
            frame_rate: per second.
            start: time of the first frame, s.
        """
        if self.theirs is None or self.aligned is None:
            return []
        rows = stick.distances(self.ours, self.theirs, self.aligned)
        tables.write_rows(layout.place(folder, layout.DISTANCES), rows)
        laid = stick.constant(self.theirs)
        places = opensim_from_world(laid.places)
        write_trc(layout.place(folder, layout.STICK), laid.names, places, frame_rate, start=start)
        return [comparison_plots.draw_sticks(layout.place(folder, layout.STICK_PLOT), self.ours, laid, self.frame)]


def compare_rigs(own: TrackedMotion, reference: Reference, lag: float, common_points: Path) -> Rigs:
    """Return the registration of both rigs and the reference's joint centres in our world, at our frames.

    It comes from a table of common points where there is one, else from the joint centres themselves, as they are
    without the lag (frames) between both. Joint centres in the world of the cameras are compared as they are.

    Raises:
        RecordingError: the table can't be read.
        MocapflowError: its points don't tell.
    """
    ours, frame = own.stick, own.columns["frame"]
    if reference.joints is None:
        return Rigs(ours=ours, frame=frame)
    theirs, aligned = (_sampled(reference, own.columns, late) for late in (0.0, lag))
    if reference.in_our_world and stick.common(ours, theirs):
        return Rigs(ours=ours, frame=frame, theirs=theirs, aligned=aligned)
    measured = common_points.is_file()
    found = stick.between_points(common_points) if measured else stick.between_joints(ours, aligned)
    if found is None:
        return Rigs(ours=ours, frame=frame, notes=("no joint distances: too few joint centres that both systems have",))
    theirs, aligned = (Stick(names=each.names, places=found.apply(each.places)) for each in (theirs, aligned))
    by = f"{len(found.residual)} points of {common_points.name}" if measured else "joint centres of both systems"
    return Rigs(
        ours=ours,
        frame=frame,
        theirs=theirs,
        aligned=aligned,
        figures=_figures(found, by),
        notes=_notes(found, by, measured),
    )


def _sampled(reference: Reference, columns: Mapping[str, F64], lag: float) -> Stick:
    """Return the joint centres of a reference at our frames, or a lag in frames before."""
    assert reference.joints is not None
    places = reference.joints.reshape(len(reference.at), -1).T
    at, ours = clocks(reference, columns, lag)
    flat = np.stack([resampled(at, place, ours, reference.step) for place in places], axis=1)
    return Stick(names=reference.joint_names, places=flat.reshape(len(ours), -1, 3))


def _figures(found: Registration, by: str) -> dict[str, Any]:
    return {
        "by": by,
        "rotation": found.rotation,
        "translation_m": found.translation,
        "scale": found.scale,
        "residual_rms_mm": 1000 * compare.rms(found.residual),
        "leave_one_out_rms_mm": 1000 * compare.rms(found.left_out),
    }


def _notes(found: Registration, by: str, measured: bool) -> tuple[str, ...]:
    residual, left_out = 1000 * compare.rms(found.residual), 1000 * compare.rms(found.left_out)
    sizes = f"residual {residual:.1f} mm, leave-one-out {left_out:.1f} mm, scale {found.scale:.4f}"
    said = f"rigs registered by {by}: {sizes}"
    if measured and abs(found.scale - 1) > ODD:
        return said, "the scale is not applied: check units and calibrations of both"
    return (said,)
