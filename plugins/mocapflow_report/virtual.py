"""Stage `virtual`: body, garment and stick model in a virtual room, without any display."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from mocapflow_export import layout
from pydantic import Field, PositiveInt

from mocapflow.components import Stage
from mocapflow.data import NO_CLOTH, PoseBatch
from mocapflow.results import Files, RunFolder, Track
from mocapflow.scene import Scene
from mocapflow_report import drawing
from mocapflow_report.room import Room


class Virtual(Stage):
    """Writes virtual/virtual.mp4: floor, cameras, the shaded body in its see-through garment, a stick model beside.

    `every` takes every so many frames; the video keeps the speed of the recording.
    """

    name: ClassVar[str] = "virtual"
    width_px: Annotated[int, Field(ge=64, multiple_of=2)] = 640  # width of the video
    height_px: Annotated[int, Field(ge=64, multiple_of=2)] = 480  # height of the video
    every: PositiveInt = 1  # takes every so many-th frame
    codec: Literal["mp4v", "vp09"] = "mp4v"  # vp09 plays in browsers, mp4v is fast

    def run(self, track: Track, scene: Scene, run_folder: RunFolder) -> Files:
        """Write the video and return its path."""
        path = layout.place(run_folder.path, layout.VIRTUAL)
        poses = PoseBatch(root=track.root, angles=track.angles)
        room = Room(scene, poses, (self.width_px, self.height_px))
        with drawing.videos([path], track.frame_rate / self.every, self.codec) as (video,):
            rows = range(0, len(track.frame), self.every)
            for done, row in enumerate(rows, 1):
                image = room.picture(scene.undressed.surface(track.pose(row), NO_CLOTH), track.cloth[row])
                drawing.label(image, f"frame {track.frame[row]}   {track.time[row]:.2f} s")
                video.write(image)
                run_folder.watch(done, len(rows))
        return Files(paths=(path,))
