"""What is damaged in a video is a gap, and so is what is made from it."""

from dataclasses import replace

import numpy as np
import pytest

from mocapflow.io.video.decoding import DAMAGED, TORN
from mocapflow.io.video.packets import decode, packets
from mocapflow.io.video.reading import open_video, read_frames
from tests.fixtures.recordings import avi_frames, mp4_frames, number_of, write_reordered, write_video
from tests.io.video.test_reading import FRAMES, numbers


def test_a_damaged_frame_leaves_a_gap(tmp_path):
    path = write_video(tmp_path / "a.avi", FRAMES, codec="MJPG")
    content = bytearray(path.read_bytes())
    offset, length = avi_frames(content)[8]
    content[offset : offset + length] = bytes(length)
    path.write_bytes(content)
    video = open_video(path)
    rows = list(read_frames(video, range(FRAMES)))
    assert [i for i, (image, _) in enumerate(rows) if image is None] == [8]
    assert rows[8] == (None, "the frame can't be decoded")
    assert [number_of(image) for image, _ in rows if image is not None] == [i for i in range(FRAMES) if i != 8]


@pytest.mark.parametrize(("ending", "bad", "key"), [("avi", 18, 28), ("avi", 12, 16), ("mp4", 18, 28), ("mp4", 12, 16)])
def test_what_is_decoded_from_a_damaged_frame_is_lost_up_to_the_next_key_frame(tmp_path, ending, bad, key):
    """Key frames are 0, 12, 16 and 28."""
    path = write_video(tmp_path / f"a.{ending}", 30, codec="XVID" if ending == "avi" else "mp4v")
    content = bytearray(path.read_bytes())
    offset, length = (avi_frames if ending == "avi" else mp4_frames)(content)[bad]
    content[offset : offset + length] = bytes(length)
    path.write_bytes(content)
    rows = list(read_frames(open_video(path), range(30)))
    assert [i for i, (image, _) in enumerate(rows) if image is None] == list(range(bad, key))
    assert {why for image, why in rows[bad + 1 : key]} == {"the frame is decoded from damaged ones"}
    assert [number_of(image) for image, _ in rows[key:]] == list(range(key, 30))


@pytest.mark.parametrize(
    ("codec", "bad", "frame", "lost"),
    [("libx264", 13, 15, range(13, 24)), ("mpeg4", 4, 6, range(4, 12)), ("mpeg4", 11, 10, range(10, 12))],
)
def test_what_is_made_from_a_frame_painted_over_is_lost(tmp_path, capfd, codec, bad, frame, lost):
    """Key frames are 0, 12 and 24. The files have 15 before 13 and 14, and that of MPEG-4 has 12 before 10 and 11.

    A decoder tells that it has painted over 15 when it has shown 13 and 14.
    """
    path = write_reordered(tmp_path / "a.mp4", 30, codec)
    content = bytearray(path.read_bytes())
    offset, length = mp4_frames(content)[bad]
    content[offset + 8 : offset + length] = np.random.default_rng(0).bytes(length - 8)
    path.write_bytes(content)
    rows = list(read_frames(open_video(path), range(30)))
    assert [i for i, (image, _) in enumerate(rows) if image is None] == list(lost)
    assert (rows[frame][1], rows[lost[-1]][1]) == (DAMAGED, TORN)
    assert all(number_of(image) == i for i, (image, _) in enumerate(rows) if image is not None)
    assert capfd.readouterr().err == ""  # ffmpeg would tell, too


def test_frames_that_the_decoder_passes_over_damage_others(tmp_path):
    """The file lacks 15, so nothing comes of 13 and 14."""
    video = open_video(write_reordered(tmp_path / "a.mp4", 30, without=[13]))
    assert numbers(video) == [*range(13), *[None] * 11, *range(24, 30)]
    assert video.frame_rate == pytest.approx(25)


def test_what_a_decoder_swallows_of_an_avi_shifts_frames_up_to_the_next_key_frame(tmp_path, monkeypatch):
    """It keeps no times of display, so reordered frames are counted; key frames are 0, 12 and 24."""

    def swallow(packet):
        frames, whole = decode(packet)
        return [frame for frame in frames if frame.pts != 3], whole

    video = open_video(write_reordered(tmp_path / "a.avi", 30, "libx264"))
    monkeypatch.setattr("mocapflow.io.video.decoding.decode", swallow)
    assert numbers(video)[12:] == list(range(12, 30))


def test_a_part_that_can_not_be_read_damages_what_follows(tmp_path, monkeypatch):
    """Key frames are 0 and 12."""
    path = write_video(tmp_path / "a.mp4", FRAMES)

    def with_hole(stream):
        for place, packet in enumerate(packets(stream)):
            yield from (None, packet) if place == 5 else (packet,)

    monkeypatch.setattr("mocapflow.io.video.packets.packets", with_hole)
    monkeypatch.setattr("mocapflow.io.video.decoding.packets", with_hole)
    assert numbers(open_video(path)) == [*range(5), *[None] * 7, *range(12, FRAMES)]


def test_a_frame_that_a_camera_left_out_damages_no_others(tmp_path):
    video = open_video(write_video(tmp_path / "a.mp4", FRAMES))
    later = np.arange(FRAMES) + (np.arange(FRAMES) >= 5)
    video = replace(video, numbers=later.astype(np.int32))
    lost = {index: why for index, (image, why) in enumerate(read_frames(video, range(FRAMES + 1))) if image is None}
    assert lost == {5: "the frame is missing in the video: its time stamps jump"}
