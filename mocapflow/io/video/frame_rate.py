"""How many frames a second all cameras of a recording take, and whether they do so evenly."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from mocapflow.assets import Camera
from mocapflow.errors import RecordingError
from mocapflow.io.cameras.pose2sim import metadata
from mocapflow.io.json_toml import place
from mocapflow.io.video.reading import Video

USUAL_RATE = 30.0  # frames per second, where nothing says it
SLOWEST, FASTEST = 1.0, 10_000.0  # frames per second; between, somebody who moves can be filmed
DIFFERENT = 1.01  # ratio of two rates, above which they are not one
OFF = 1.0  # frames by which a picture may be off the rhythm of the numbers, or two videos apart at their end


def common_rate(cameras: Sequence[Camera], videos: Sequence[Video], calibration: Path) -> tuple[float, list[str]]:
    """Return the frames per second, as [metadata] says or as the videos do, and what is odd about it.

    Raises:
        RecordingError: it is stated as something else than a rate, or the videos differ by more than 1 %.
    """
    stated, odd = _stated(calibration), _interlaced(cameras, videos)
    rates = {c.name: v.frame_rate for c, v in zip(cameras, videos, strict=True) if v.frame_rate}
    toml = calibration.name if calibration.suffix == ".toml" else "a cameras.toml, which this calibration has to become"
    told = f"frame_rate under [metadata] in {toml}"
    if not rates:
        assumed = f"nothing says the frame rate: {USUAL_RATE:g} frames per second assumed; write {told}"
        return (USUAL_RATE, [*odd, assumed]) if stated is None else (stated, odd)
    rate, ratio = Counter(rates.values()).most_common(1)[0][0], max(rates.values()) / min(rates.values())
    each = ", ".join(f"{name}: {rate:.6g} per second" for name, rate in rates.items())
    odd += _uneven(cameras, videos, rate)
    if ratio > DIFFERENT:
        if stated is None:
            hint = f"{each}\nrecord all cameras at one rate, convert to it: {_command(rate)}\nor write the true {told}"
            raise RecordingError("the videos differ in frame rate", where=str(videos[0].path.parent), hint=hint)
        odd.append(f"the videos differ in frame rate ({each}): {stated:g} is taken for all")
    elif (apart := (ratio - 1) * max(video.frames for video in videos)) > OFF:
        odd.append(f"at their end the videos are {apart:.1f} frames apart ({each}); convert them: {_command(rate)}")
    return rate if stated is None else stated, odd


def _stated(calibration: Path) -> float | None:
    """Return the frames per second under [metadata] of a calibration.

    Raises:
        RecordingError: it is stated as something else than a rate.
    """
    stated = metadata(calibration).get("frame_rate")
    if stated is None:
        return None
    if isinstance(stated, int | float) and not isinstance(stated, bool) and SLOWEST <= stated <= FASTEST:
        return float(stated)
    hint = f"write frames per second, {SLOWEST:g} to {FASTEST:g}, or leave it out: then the videos say it"
    raise RecordingError(f"frame_rate is {stated!r}", where=place(calibration, "frame_rate"), hint=hint)


def _interlaced(cameras: Sequence[Camera], videos: Sequence[Video]) -> list[str]:
    """Say whose pictures show two moments each."""
    return [
        f"{camera.name}: its video is interlaced, each picture shows two moments; ffmpeg -i IN -vf bwdif=0 -crf 12 OUT"
        for camera, video in zip(cameras, videos, strict=True)
        if video.interlaced
    ]


def _uneven(cameras: Sequence[Camera], videos: Sequence[Video], rate: float) -> list[str]:
    """Say whose frames are of other moments than their numbers say, as those of a phone that slows down in the dark.

    The rate is that of the videos: who states another one has filmed slow motion.
    """
    return [
        f"{camera.name}: its frame rate varies, which puts frames up to {video.uneven:.1f} from their place; "
        f"convert it to an even rate: {_command(rate)}"
        for camera, video in zip(cameras, videos, strict=True)
        if video.uneven > OFF
    ]


def _command(rate: float) -> str:
    return f"ffmpeg -i IN -vf fps={rate:.6g} -crf 12 OUT"
