from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from mocapflow_evaluation.evaluate import Evaluate
from mocapflow_export import layout, tables
from mocapflow_report import drawing, portrait, raster, report_rows
from mocapflow_report.overlay import Overlay, Painter
from mocapflow_report.report import Report
from mocapflow_report.room import Room
from mocapflow_report.stills import chosen_rows, stills
from mocapflow_report.virtual import Virtual
from mocapflow_sequence.smooth import Smooth
from results_scene import DEMO, demo_scene, stepping

from mocapflow.data import NO_CLOTH, Pose, PoseBatch
from mocapflow.errors import StoreError
from mocapflow.geometry import cameras, kinematics
from mocapflow.io.motion.csv_columns import read_columns
from mocapflow.knocks import Knocks
from mocapflow.recordings.recording import Recording, open_recording
from mocapflow.results import Evaluation, RunFolder, Track, ViewChecks
from mocapflow.scene import Scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return demo_scene(clothed=True)


@pytest.fixture(scope="module")
def track(scene: Scene) -> Track:
    assert scene.garment is not None
    bare = stepping(scene.body, 4)
    garment = scene.garment.vertices
    return replace(bare, cloth=np.stack([garment @ root[:3, :3].T + root[:3, 3] for root in bare.root]))


@pytest.fixture(scope="module")
def recording() -> Recording:
    return open_recording(DEMO, stop=4)


def read_back(path: Path) -> np.ndarray:
    video, frames = cv2.VideoCapture(str(path)), []
    while (read := video.read())[0]:
        frames.append(read[1])
    return np.array(frames)


def near(image: np.ndarray, colour: drawing.Colour) -> int:
    return int((np.abs(image.astype(int) - colour).max(-1) < 40).sum())


def test_overlay_shows_outline_garment_and_skeleton(
    scene: Scene, track: Track, recording: Recording, tmp_path: Path
) -> None:
    """T-OUT2."""
    files = Overlay().run(track=track, scene=scene, recording=recording, run_folder=RunFolder(path=tmp_path, recipe={}))
    assert [p.relative_to(tmp_path) for p in files.paths] == [layout.overlay(f"cam0{k}") for k in (1, 2, 3, 4)]
    assert all(read_back(path).shape == (4, 800, 640, 3) for path in files.paths)  # small images are enlarged
    frame = next(recording.frames())
    for view in range(4):  # before compression, which blurs thin coloured lines
        image = Painter(scene).paint(frame, track, 0)[view]
        for colour in (drawing.BODY, drawing.CLOTH, drawing.BONE):
            assert near(image, colour) > 200


def test_overlay_of_a_lost_view_says_so(scene: Scene, track: Track, recording: Recording, tmp_path: Path) -> None:
    def frames() -> list[object]:
        lost = np.array([True, False, True, True])
        return [replace(f, usable=lost, reasons=("", "black", "", "")) for f in recording.frames()]

    run_folder = RunFolder(path=tmp_path, recipe={})
    fake = SimpleNamespace(frames=frames, run_rate=recording.run_rate)
    shown = [
        read_back(Overlay().run(track=track, scene=scene, recording=source, run_folder=run_folder).paths[1])[0][:80]
        for source in (recording, fake)
    ]
    assert np.abs(shown[0].astype(int) - shown[1]).max() > 100


def test_the_report_says_at_once_which_frames_the_images_contradict(track: Track) -> None:
    doubted = replace(track, doubted=np.arange(len(track.frame)) == 1)
    said, names = "1 of 4 frames are doubted: images or keypoints contradict them", ["cam01", "cam02", "cam03", "cam04"]
    assert said not in report_rows.glance(track, names, None) and said in report_rows.glance(doubted, names, None)
    assert report_rows.mishaps(track, {}) == []
    assert report_rows.mishaps(doubted, {}) == ["frames that images or keypoints contradict: 1"]
    (swings,) = report_rows.mishaps(replace(track, oscillating=np.arange(len(track.frame)) >= 2), {})
    assert swings == "frames that swing between two states: 2–3"


def test_the_report_says_how_long_the_limbs_of_the_body_are(scene: Scene) -> None:
    names = [item.rsplit(" ", 2)[0] for item in report_rows.body(scene).split("; ")]
    limbs = ("thigh", "shank", "upper arm", "forearm")
    sides = [f"{limb}, {side}" for limb in limbs for side in ("left", "right")]
    assert names == ["height", *sides]
    legs = replace(scene, body=replace(scene.body, cut=np.arange(len(scene.body.vertices)) == 0))
    assert report_rows.body(legs).startswith(sides[0])  # that of a part is not the person's


@pytest.mark.parametrize(
    "odd",
    [{"doubted": np.ones(4, bool)}, {"usable": np.tile([True, False, True, True], (4, 1))}],
    ids=["doubted", "not used"],
)
def test_overlay_of_an_odd_frame_says_so(
    scene: Scene, track: Track, recording: Recording, odd: dict[str, np.ndarray]
) -> None:
    frame = next(recording.frames())
    plain, said = (Painter(scene).paint(frame, each, 0)[1] for each in (track, replace(track, **odd)))
    differs = np.flatnonzero(np.any(plain != said, axis=(1, 2)))
    assert 0 < len(differs) < 80  # a line of text at the top
    assert differs.max() < 160


def test_virtual_room_moves_with_the_person(scene: Scene, track: Track, tmp_path: Path) -> None:
    """T-OUT2."""
    run_folder = RunFolder(path=tmp_path, recipe={})
    (path,) = Virtual(width_px=320, height_px=240).run(track=track, scene=scene, run_folder=run_folder).paths
    video = read_back(path)
    assert video.shape == (4, 240, 320, 3)
    assert np.abs(video[0].astype(int) - video[3]).max() > 60
    (every,) = Virtual(width_px=320, height_px=240, every=3).run(track=track, scene=scene, run_folder=run_folder).paths
    assert len(read_back(every)) == 2


@pytest.mark.parametrize("above", [0.0, 1.0])
def test_the_floor_is_below_whoever_crouches(scene: Scene, above: float) -> None:
    """Feet stay on it; the pelvis sinks by a third of a metre and more."""
    names, poses = scene.body.screw_names, stepping(scene.body, 3)
    root, angles = poses.root.copy(), poses.angles.copy()
    for side in "lr":
        angles[:, names.index(f"hip_{side}.x")] -= 1.2
        angles[:, names.index(f"knee_{side}.x")] += 2.2
        angles[:, names.index(f"ankle_{side}.x")] -= 1.0
    first = Pose(root=root[0].copy(), angles=angles[0].copy())
    root[:, 2, 3] += above - scene.undressed.surface(first, NO_CLOTH).vertices[:, 2].min()
    assert kinematics.root_position(scene.body, root)[0, 2] < above + 0.7
    assert abs(Room(scene, PoseBatch(root=root, angles=angles), (64, 64))._floor - above) < 0.1


def test_rasteriser_draws_where_the_camera_projects() -> None:
    view = raster.look_at(np.array([3.0, -2.0, 1.5]), np.array([0.0, 0.0, 1.0]), (320, 240), 40.0)
    canvas = raster.Canvas(np.zeros((240, 320, 3), np.float32), view)
    corners = np.array([[0.1, 0.2, 1.1], [0.13, 0.2, 1.1], [0.1, 0.2, 1.13], [0.1, 0.23, 1.1]])
    canvas.draw(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.ones((4, 3), np.float32))
    drawn = np.argwhere(canvas.picture[..., 0] > 0).mean(0)[::-1]
    assert np.abs(drawn - cameras.project(corners, view).mean(0)).max() < 2


def test_nearest_triangle_is_seen_and_a_veil_shines_through() -> None:
    view = raster.look_at(np.array([0.0, -3.0, 0.0]), np.zeros(3), (64, 64), 40.0)
    square, faces = (
        np.array([[-1.0, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]]),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
    )
    white, grey = np.ones((4, 3), np.float32), np.full((4, 3), 0.5, np.float32)
    canvas = raster.Canvas(np.zeros((64, 64, 3), np.float32), view)
    canvas.draw(square, faces, white)
    canvas.draw(square + [0, 1.0, 0], faces, grey)  # behind
    assert canvas.picture[32, 32, 0] == pytest.approx(1)
    canvas.veil(square - [0, 1.0, 0], faces, grey, 0.4)  # before
    assert canvas.picture[32, 32, 0] == pytest.approx(0.4 * 0.5 + 0.6)


def test_a_canvas_knows_what_triangles_may_cover() -> None:
    view = raster.look_at(np.array([0.0, -3.0, 0.0]), np.zeros(3), (64, 48), 40.0)
    corners, faces = np.array([[0.0, 0, 0], [2.0, 0, 0], [0.0, 0, 0.3]]), np.array([[0, 1, 2]], np.int32)
    drawn, veiled = (raster.Canvas(np.zeros((48, 64, 3), np.float32), view) for _ in range(2))
    drawn.draw(corners, faces, np.ones((3, 3), np.float32))
    veiled.veil(corners, faces, np.ones((3, 3), np.float32), 0.5)
    np.testing.assert_allclose(veiled.picture, 0.5 * drawn.picture)
    rows, columns = np.nonzero(drawn.picture[..., 0])
    box = veiled.box(corners)
    assert box[0].start <= rows.min() <= rows.max() < box[0].stop <= rows.max() + 4
    assert box[1].start <= columns.min() and columns.max() == 63 and box[1].stop == 64  # it leaves the picture
    assert veiled.box(corners - [0, 4.0, 0]) == (slice(None), slice(None))  # behind the camera: anything may be


@pytest.mark.long
def test_report_holds_everything(scene: Scene, track: Track, recording: Recording, tmp_path: Path) -> None:
    run_folder = RunFolder(path=tmp_path, recipe={"pipeline": "<skirt>", "versions": {"numpy": "2"}})
    observed = track.observed.copy()
    observed[2, scene.body.screw_joint == scene.body.joint("hip_r")] = 0.1
    noted = Smooth().run(
        track=replace(
            track, notes=("frame 1: cam02 black", "frame 2: cam02 black", "frame 2: fit doubted"), observed=observed
        ),
        scene=scene,
    )
    evaluation = Evaluate().run(track=noted, scene=scene, recording=recording, run_folder=run_folder)
    files = Report().run(track=noted, scene=scene, recording=recording, run_folder=run_folder, evaluation=evaluation)
    page = (tmp_path / layout.REPORT).read_text()
    assert set(files.paths) == {tmp_path / part for part in (layout.REPORT, layout.PLOT, layout.OVERLAP)}
    said = (
        "knee flexion, left",
        "frames 1–2: cam02 black",
        "frame 2: fit doubted",
        "&lt;skirt&gt;",
        "numpy 2",
        "best: frame",
        "worst: frame",
    )
    for text in (*said, "segment", "hip flexion, right: held by the priors in 1 frames"):
        assert text in page
    assert page.count("data:image/jpeg;base64") == 3
    assert page.count("data:image/png;base64") == 4  # angles, overlap, agreement, stick models (truth/joints.npz)


class Links(HTMLParser):
    """Collects whatever a page would fetch."""

    def __init__(self) -> None:
        super().__init__()
        self.fetched: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag in ("script", "link", "iframe", "object", "embed"):
            self.fetched.append(tag)
        self.fetched += [str(value) for name, value in attrs if name in ("src", "href", "srcset", "style", "data")]


@pytest.fixture(scope="module")
def page(scene: Scene, track: Track, recording: Recording, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The report of a run that was compared with nothing."""
    folder = tmp_path_factory.mktemp("report")
    Report().run(track=track, scene=scene, recording=recording, run_folder=RunFolder(path=folder, recipe={}))
    return (folder / layout.REPORT).read_text()


def test_report_fetches_nothing(page: str) -> None:
    links = Links()
    links.feed(page)
    assert len(links.fetched) == 5
    assert all(link.startswith("data:image/") for link in links.fetched)
    style = page[page.index("<style>") : page.index("</style>")]
    assert "url(" not in style and "@import" not in style


def test_report_counts_the_frames_of_the_run_and_their_rate(
    scene: Scene, track: Track, recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every third of 30 pictures a second."""
    pictures = [layout.place(tmp_path, part) for part in (layout.PLOT, layout.OVERLAP)]
    for picture in pictures:
        picture.touch()
    monkeypatch.setattr("mocapflow_report.report.draw", lambda *_: pictures)
    monkeypatch.setattr("mocapflow_report.report.stills", lambda *_: [])
    sparse = replace(recording, indices=range(0, 12, 3))
    Report().run(track=track, scene=scene, recording=sparse, run_folder=RunFolder(path=tmp_path, recipe={}))
    assert "4 frames, 4 cameras, 10 per second" in (tmp_path / layout.REPORT).read_text()


@pytest.mark.long
def test_report_without_reference(scene: Scene, track: Track, recording: Recording, page: str, tmp_path: Path) -> None:
    run_folder = RunFolder(path=tmp_path, recipe={})
    nothing = Evaluation(reference="", rows=(), notes=("the recording has no truth/angles.csv",))
    Report().run(track=track, scene=scene, recording=recording, run_folder=run_folder, evaluation=nothing)
    assert "no truth/angles.csv" in (tmp_path / layout.REPORT).read_text()
    assert "Deviation" not in page


@pytest.mark.usefixtures("unrendered")  # the report draws the angles, not the evaluation
@pytest.mark.long
def test_an_angle_that_the_reference_never_has_is_drawn_without_it(
    scene: Scene, track: Track, recording: Recording, tmp_path: Path
) -> None:
    truth = read_columns(DEMO / "truth" / "angles.csv")
    truth["ankle_l"] = np.full(len(truth["frame"]), np.nan)
    tables.write_columns(tmp_path / "known.csv", truth)
    given = {"track": track, "scene": scene, "recording": recording, "run_folder": RunFolder(path=tmp_path, recipe={})}
    evaluation = Evaluate(reference=str(tmp_path / "known.csv")).run(**given)
    assert "ankle_r" in evaluation.curves and "ankle_l" not in evaluation.curves
    Report().run(**given, evaluation=replace(evaluation, pictures=()))


def test_shown_frames_are_best_median_and_worst(track: Track) -> None:
    overlap = np.array([[0.5, 0.7], [0.9, np.nan], [0.8, 0.8], [np.nan, np.nan]])
    assert chosen_rows(replace(track, overlap=overlap, usable=np.ones((4, 2), bool))) == {
        "best": 1,
        "median": 2,
        "worst": 0,
    }
    unknown = replace(track, overlap=np.full((4, 4), np.nan))
    assert chosen_rows(unknown) == {"first": 0, "middle": 2, "last": 3}


def test_pictures_of_knocked_cameras_are_drawn_on_moved_back(
    scene: Scene, track: Track, recording: Recording, tmp_path: Path
) -> None:
    first, down = np.zeros(1, np.int32), np.array([[1.0, 0, 0], [0, 1, 40], [0, 0, 1]])
    knocks = Knocks(frame=first, camera=np.ones(1, np.int16), turn=down[None])
    checks = ViewChecks(frame=first[:0], camera=np.empty(0, np.int16), reasons=(), knocks=knocks)
    given = {"track": track, "scene": scene, "recording": recording}
    run_folder = RunFolder(path=tmp_path, recipe={})
    knocked, still = (
        [read_back(path) for path in Overlay().run(**given, run_folder=run_folder, checks=c).paths]
        for c in (checks, None)
    )
    assert np.abs(knocked[0].astype(int) - still[0]).max() == 0
    assert np.abs(knocked[1].astype(int) - still[1]).mean() > 1
    assert stills(**given, checks=checks) != stills(**given)


def test_progress_ends_with_the_last_frame_shown(scene: Scene, track: Track, recording: Recording) -> None:
    told: list[tuple[int, int]] = []
    overlap = np.array([[0.7], [0.9], [0.8], [np.nan]]) * np.ones((1, 4))
    stills(replace(track, overlap=overlap), scene, replace(recording, watch=lambda *count: told.append(count)))
    assert told == [(1, 3), (2, 3), (3, 3)]


def test_unwritable_video_is_an_error_for_people(tmp_path: Path) -> None:
    video = drawing.Video(tmp_path / "no" / "folder.mp4", 30.0, "mp4v")
    with pytest.raises(StoreError, match="can't write a video with codec mp4v"):
        video.write(np.zeros((64, 64, 3), np.uint8))


def test_a_video_that_is_cut_off_leaves_the_one_before_it(tmp_path: Path) -> None:
    path, image = tmp_path / "a.mp4", np.zeros((64, 64, 3), np.uint8)
    with drawing.videos([path], 30.0, "mp4v") as (video,):
        video.write(image)
    before = path.read_bytes()
    with pytest.raises(KeyboardInterrupt), drawing.videos([path], 30.0, "mp4v") as (video,):
        video.write(image)
        video.write(image)
        raise KeyboardInterrupt
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_video_that_the_drive_had_no_room_for_is_an_error(tmp_path: Path, monkeypatch) -> None:
    """OpenCV says nothing: the table of contents, at the end, is missing."""
    close = drawing.Video.close

    def cut(video: drawing.Video) -> None:
        close(video)
        (part,) = tmp_path.iterdir()
        part.write_bytes(part.read_bytes()[:200])

    monkeypatch.setattr(drawing.Video, "close", cut)
    with (
        pytest.raises(StoreError, match=r"a video is not whole after it was written\n.*is the drive full\?"),
        drawing.videos([tmp_path / "a.mp4"], 30.0, "mp4v") as (video,),
    ):
        video.write(np.zeros((64, 64, 3), np.uint8))
    assert list(tmp_path.iterdir()) == []


def test_strands_without_rings_have_a_pattern_of_their_length_alone(scene: Scene) -> None:
    assert scene.garment is not None
    rings, length = scene.garment.rings, scene.garment.ring_length
    fringe = replace(scene.garment, rings=rings[:0], ring_length=length[:0])
    ink = [portrait.pattern(garment).std() for garment in (fringe, scene.garment)]
    assert 0 < ink[0] < ink[1]


def test_cloth_that_cuts_through_the_skin_it_lies_on_covers_it_and_cloth_behind_it_does_not() -> None:
    camera = raster.look_at(np.array([0.0, -3.0, 0.0]), np.zeros(3), (64, 64), 40.0)
    square = np.array([[-1.0, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]])
    faces, white = np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.ones((4, 3), np.float32)
    for deeper, shade in ((-0.5, 0.5), (raster.CUT / 2, 0.5), (2 * raster.CUT, 1.0)):
        canvas = raster.Canvas(np.full((64, 64, 3), 0.2, np.float32), camera)
        canvas.draw(square * 0.5, faces, white)
        canvas.veil(square + [0, deeper, 0], faces, np.zeros((4, 3), np.float32), 0.5)
        np.testing.assert_allclose(canvas.picture[32, 32], shade, atol=1e-3)
        np.testing.assert_allclose(canvas.picture[4, 32], 0.1, atol=1e-3)  # nothing behind it but the room
        assert canvas.depth[32, 32] <= 3.0 + 1e-3
