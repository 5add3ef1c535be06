"""Frames in order, and gaps that stay gaps."""

import os
import wave
from dataclasses import replace
from fractions import Fraction

import av
import cv2
import numpy as np
import pytest

from mocapflow.errors import RecordingError
from mocapflow.io.video.decoding import DAMAGED
from mocapflow.io.video.reading import count_from_first, open_video, read_frames
from tests.fixtures.recordings import avi_frames, number_of, picture, write_reordered, write_video

FRAMES = 20


def numbers(video, indices=None):
    indices = range(video.frames) if indices is None else indices
    return [None if image is None else number_of(image) for image, _ in read_frames(video, indices)]


@pytest.mark.parametrize(("ending", "codec"), [("mp4", "mp4v"), ("avi", "MJPG"), ("avi", "XVID"), ("mkv", "mp4v")])
def test_frames_are_in_order_and_counted(tmp_path, ending, codec):
    video = open_video(write_video(tmp_path / f"a.{ending}", FRAMES, codec=codec))
    assert (video.width, video.height, video.frames, video.declared) == (64, 48, FRAMES, FRAMES)
    assert video.frame_rate == pytest.approx(25, rel=1e-3)
    assert numbers(video) == list(range(FRAMES))


@pytest.mark.parametrize("indices", [range(7, 12), range(19, 20), range(2, 20, 5), range(0)])
def test_reading_a_part_gives_the_same_pixels(tmp_path, indices):
    video = open_video(write_video(tmp_path / "a.mp4", FRAMES))
    whole = [image for image, _ in read_frames(video, range(FRAMES))]
    part = [image for image, _ in read_frames(video, indices)]
    assert len(part) == len(indices)
    for index, image in zip(indices, part, strict=True):
        np.testing.assert_array_equal(image, whole[index])


def test_packets_with_one_time_are_one_frame(tmp_path):
    """VP8 has some that nobody sees, with the time of the next."""
    video = open_video(write_video(tmp_path / "a.mp4", FRAMES))
    video = replace(video, numbers=np.maximum(np.arange(FRAMES) - 6, 0).astype(np.int32))
    assert numbers(video) == [0, *range(7, FRAMES)]


@pytest.mark.parametrize("codec", ["mpeg4", "libx264"])
@pytest.mark.parametrize("ending", ["mp4", "avi", "mkv"])
def test_reordered_frames(tmp_path, ending, codec):
    assert numbers(open_video(write_reordered(tmp_path / f"a.{ending}", 30, codec))) == list(range(30))


def test_players_do_not_show_what_is_cut_off_without_encoding_again(tmp_path):
    video = open_video(write_reordered(tmp_path / "a.mp4", 30, hidden=5))
    assert (video.frames, video.declared, video.frame_rate) == (25, 25, 25.0)
    assert numbers(video) == list(range(5, 30))
    assert count_from_first([video])[0].first == 0
    with pytest.raises(RecordingError, match="this video can't be decoded"):
        open_video(write_reordered(tmp_path / "b.mp4", 12, hidden=12))


@pytest.mark.parametrize(
    ("matrix", "turns"),
    [((0, 1, -1, 0), 1), ((-1, 0, 0, -1), 2), ((0, -1, 1, 0), 3), ((-1, 1, -1, -1), 0), ((-1, -1, 1, -1), 0)],
)
def test_pictures_are_turned_as_players_do(tmp_path, matrix, turns):
    upright = write_video(tmp_path / "a.mp4", 6)
    content = bytearray(upright.read_bytes())
    at = content.index(b"tkhd") + 44
    for place, number in zip((0, 4, 12, 16), matrix, strict=True):
        content[at + place : at + place + 4] = (number * 65536).to_bytes(4, "big", signed=True)
    (tmp_path / "b.mp4").write_bytes(content)
    video = open_video(tmp_path / "b.mp4")
    assert (video.width, video.height) == ((48, 64) if turns % 2 else (64, 48))
    capture = cv2.VideoCapture(str(video.path))
    for (image, _), (before, _) in zip(
        read_frames(video, range(6)), read_frames(open_video(upright), range(6)), strict=True
    ):
        np.testing.assert_array_equal(image, capture.read()[1])
        np.testing.assert_array_equal(np.rot90(image, turns), before)


@pytest.mark.parametrize("kind", ["yuv420p", "yuv420p10le", "gray", "bgr0"])
def test_pictures_are_those_of_opencv(tmp_path, kind):
    """Those of ten bits are scaled by a filter."""
    path = str(tmp_path / "a.mkv")
    with av.open(path, "w") as file:
        stream = file.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = 62, 46, kind
        noise = np.random.default_rng(0).integers(0, 256, (46, 62, 3), np.uint8)
        file.mux(stream.encode(av.VideoFrame.from_ndarray(noise, "bgr24")) + stream.encode(None))
    ((image, _),) = read_frames(open_video(tmp_path / "a.mkv"), range(1))
    np.testing.assert_array_equal(image, cv2.VideoCapture(path).read()[1])


def test_a_title_that_is_no_utf8(tmp_path):
    path = write_video(tmp_path / "a.mp4", 3)
    path.write_bytes(path.read_bytes().replace(b"Lavf", b"L\xe4vf"))
    assert numbers(open_video(path)) == [0, 1, 2]


def test_a_truncated_video_has_placeholders_to_the_end(tmp_path):
    path = write_video(tmp_path / "a.avi", FRAMES, codec="MJPG")
    content = path.read_bytes()
    offset, length = avi_frames(content)[12]
    path.write_bytes(content[: offset + length - 8])
    video = open_video(path)
    assert video.declared == FRAMES
    rows = list(read_frames(video, range(FRAMES)))
    assert [number_of(image) for image, _ in rows[:12]] == list(range(12))
    assert {image is None for image, _ in rows[12:]} == {True}
    assert rows[12][1] == DAMAGED
    assert rows[-1][1] == f"the video breaks off after frame {video.frames - 1}"


def test_a_late_video_ends_earlier_and_is_not_broken(tmp_path):
    video = replace(open_video(write_video(tmp_path / "a.avi", FRAMES)), late=3)
    rows = list(read_frames(video, range(FRAMES)))
    assert [reason for image, reason in rows if image is None] == ["the video ends earlier"] * 3
    early = list(read_frames(replace(video, late=-2), range(4)))
    assert [reason for _, reason in early] == ["the video starts later"] * 2 + [""] * 2


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("ending", ["mp4", "mkv", "avi"])
def test_a_video_of_hardly_any_pictures(tmp_path, count, ending):
    video = open_video(write_video(tmp_path / f"a.{ending}", count))
    assert (video.frames, video.declared, video.frame_rate, video.uneven) == (count, count, 25.0, 0.0)
    assert [number_of(image) for image, _ in read_frames(video, range(count))] == list(range(count))


def test_a_frame_rate_that_no_camera_has_says_nothing(tmp_path):
    assert open_video(write_video(tmp_path / "a.mov", 3, rate=2e5, codec="MJPG")).frame_rate == 0


def test_frames_that_come_unevenly_are_told_from_a_file(tmp_path):
    """Every other one a fifth of a frame early, the others as late."""
    with av.open(str(tmp_path / "a.mkv"), "w") as file:
        stream = file.add_stream("mpeg4", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        stream.codec_context.time_base = Fraction(1, 1000)
        for number in range(20):
            frame = av.VideoFrame.from_ndarray(picture(number), "bgr24")
            frame.pts, frame.time_base = 40 * number + (8 if number % 2 else -8) + 8, Fraction(1, 1000)
            file.mux(stream.encode(frame))
        file.mux(stream.encode(None))
    video = open_video(tmp_path / "a.mkv")
    assert video.frames == 20 and video.uneven == pytest.approx(0.2, abs=0.03)


@pytest.mark.parametrize("name", ["a.mkv", "a.mpg"])
def test_sound_that_is_longer_than_the_pictures_is_no_video_that_breaks_off(tmp_path, name):
    with av.open(str(tmp_path / name), "w") as file:
        stream = file.add_stream("mpeg2video", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        sound = file.add_stream("mp2", rate=16000, layout="mono")
        silence = av.AudioFrame.from_ndarray(np.zeros((1, 48000), np.int16), "s16", "mono")
        silence.sample_rate = 16000
        file.mux(sound.encode(silence))
        for number in range(10):
            frame = av.VideoFrame.from_ndarray(picture(number), "bgr24")
            frame.pts = number + 2
            file.mux(stream.encode(frame))
        file.mux(stream.encode(None))
    video = open_video(tmp_path / name)
    assert (video.frames, video.declared) == (10, 10)


def test_a_truncated_mp4_can_not_be_decoded(tmp_path):
    path = write_video(tmp_path / "a.mp4", FRAMES)
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(
        RecordingError, match=r"a\.mp4  this video can't be decoded\n       the file is cut off, damaged"
    ):
        open_video(path)


def test_a_link_that_leads_nowhere(tmp_path):
    (tmp_path / "a.mp4").symlink_to(tmp_path / "gone.mp4")
    with pytest.raises(RecordingError, match=r"no such video\n       it is a link to .*gone\.mp4, where nothing is"):
        open_video(tmp_path / "a.mp4")
    write_video(tmp_path / "gone.mp4", 3)
    assert open_video(tmp_path / "a.mp4").frames == 3


def test_a_video_that_may_not_be_read(tmp_path, monkeypatch):
    path = tmp_path / "a.mp4"
    path.touch()
    monkeypatch.setattr(os, "access", lambda *_: False)  # who runs the tests may be allowed everything
    with pytest.raises(RecordingError, match=r"a\.mp4  this video may not be read: permission denied"):
        open_video(path)


@pytest.mark.parametrize(("width", "height"), [(32, 24), (32, 48), (64, 24)])
def test_frames_of_another_size_are_lost(tmp_path, width, height):
    for number in range(4):
        size = (64, 48) if number != 2 else (width, height)
        cv2.imwrite(str(tmp_path / f"{number:06d}.png"), picture(number, size))
    rows = list(read_frames(open_video(tmp_path), range(4)))
    assert rows[2] == (None, f"the frame is {width} x {height}, the others 64 x 48")
    assert [number_of(rows[i][0]) for i in (0, 1, 3)] == [0, 1, 3]


def test_a_folder_of_images(tmp_path):
    for number in (0, 1, 3, 4):
        cv2.imwrite(str(tmp_path / f"{number:06d}.png"), picture(number))
    (tmp_path / "000004.png").write_bytes(b"no image")
    (tmp_path / "notes.txt").write_text("12")
    (tmp_path / "cover.png").touch()
    video = open_video(tmp_path)
    assert (video.frames, video.frame_rate) == (5, 0.0)
    assert numbers(video) == [0, 1, None, 3, None]
    assert [reason for _, reason in read_frames(video, range(2, 5))] == [
        "there is no image of this frame", "", "000004.png can't be read",
    ]  # fmt: skip


def test_two_images_of_one_frame_are_told_apart_by_nobody(tmp_path):
    for number in range(3):
        cv2.imwrite(str(tmp_path / f"frame_{number:06d}_cam1.png"), picture(number))
    with pytest.raises(RecordingError, match="two files for frame 1: frame_000000_cam1.png, frame_000001_cam1.png\n"):
        open_video(tmp_path)


def test_a_single_image_may_be_of_a_late_frame(tmp_path):
    cv2.imwrite(str(tmp_path / "005999.png"), picture(1))
    assert open_video(tmp_path).frames == 6000


@pytest.mark.parametrize("first", [20260131, 1700000000000])
def test_images_named_by_date_or_time(tmp_path, first):
    for name in (first, first + 33):
        cv2.imwrite(str(tmp_path / f"{name}.png"), np.zeros((8, 8, 3), np.uint8))
    with pytest.raises(
        RecordingError, match=f"2 images, and {first + 33}.png would be frame {first + 33}\n.*not its time"
    ):
        open_video(tmp_path)


def test_twelve_bits_in_sixteen(tmp_path):
    cv2.imwrite(str(tmp_path / "000000.png"), picture(1).astype(np.uint16) * 16)
    with pytest.raises(RecordingError, match=r"000000\.png  a picture of 16 bits .* reaches 3520 of 65535.*\n.*8 bits"):
        open_video(tmp_path)
    for number in (1, 0):
        cv2.imwrite(str(tmp_path / "000000.png"), (picture(number) * (number > 0)).astype(np.uint16) * 257)
        assert numbers(open_video(tmp_path)) == [number]  # also of a room in the dark


def test_what_is_no_video(tmp_path):
    (tmp_path / "a.mp4").write_text("hello")
    with wave.open(str(tmp_path / "b.mp4"), "wb") as sound:
        sound.setparams((1, 2, 8000, 0, "NONE", ""))
        sound.writeframes(bytes(8000))
    for name in ("a.mp4", "b.mp4", "gone.mp4"):
        with pytest.raises(RecordingError, match="this video can't be decoded|may not be read"):
            open_video(tmp_path / name)
    (tmp_path / "cam01").mkdir()
    with pytest.raises(RecordingError, match=r"no image in this folder can be read\n.*000000\.png"):
        open_video(tmp_path / "cam01")


def test_folders_of_images_count_from_the_first_that_any_has(tmp_path):
    for name, numbers in (("a", (5, 6, 8)), ("b", (6, 7))):
        (tmp_path / name).mkdir()
        for number in numbers:
            cv2.imwrite(str(tmp_path / name / f"{number:03}.png"), picture(number))
    videos = count_from_first([open_video(tmp_path / name) for name in "ab"])
    assert [video.numbers.tolist() for video in videos] == [[0, 1, 3], [1, 2]]
    assert [(video.first, video.declared, video.frames) for video in videos] == [(5, 4, 4), (5, 3, 3)]
