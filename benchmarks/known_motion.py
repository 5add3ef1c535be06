"""Recordings of known motion with physics cloth, against which a track can be measured.

`apt install blender python3-numpy ffmpeg`, then `python benchmarks/known_motion.py TAKE DATA OUT`. TAKE is one of
`known_takes.TAKES`; DATA holds the recordings walk_skirt (subject A, her skirt) and kneeup_shorts (subject B, his
shorts) and the folder motions; OUT/TAKE becomes a recording folder: cameras, videos, clean plates, subject, init.json,
truth. The body is posed in `known_poses.py`, by a motion of DATA or of `known_scripts.py`, the garment sewn in
`known_garments.py`; `known_motion_blender.py` drapes it with Blender's cloth and draws what each camera sees; softness
of the lens and noise of the sensor are added here. Nothing of the tracker takes part, its kinematics neither: what
shared code with it could not tell that it is wrong. On one core about 2 s a view: 8 minutes a take of 50 frames.
OUT/room_A and so on keep the empty rooms for the next take; delete them when the room, the light or the cameras here
have changed. Where a limb has come through the cloth, which the simulation does not prevent, the take's README says so.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tomllib
from dataclasses import asdict, replace
from pathlib import Path

import cv2
import numpy as np
import open3d as o3d
from known_garments import ARM, measures_for, sew, together
from known_people import BUILDS, built, write_body
from known_poses import RATE, Body, Motion, angles, chain, ground, read_body, skin
from known_rigs import RIGS
from known_scripts import SCRIPTS
from known_takes import TAKES, Take
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation, Slerp

APPROACH, HOLD = 30, 15  # frames from rest to the first pose, and of standing there
RUN_UP = 10  # frames of the motion before frame 0
PLATES = 8  # empty rooms drawn per camera
TONE = 0.965  # of a frame to its clean plate, as in the shared recordings
SOFTNESS_PX, NOISE = 0.7, 3.0
SKIN, HAIR, UNDERWEAR = (0.56, 0.33, 0.21), (0.05, 0.035, 0.03), (0.10, 0.10, 0.12)
SHIRT, SOCKS = {"A": (0.16, 0.33, 0.60), "B": (0.55, 0.10, 0.10)}, {"A": (0.80, 0.80, 0.80), "B": (0.03, 0.03, 0.035)}
LEG = ("hip", "knee", "ankle")
RECORDINGS, OWNER = {"A": "walk_skirt", "B": "kneeup_shorts"}, {"skirt": "A", "shorts": "B"}


ABOUT = """# {name}

Rendered recording of known motion: {take.frames} frames at {rate:g} a second, subject {take.subject},
motion {take.motion} from its frame {take.start}, {take.worn} simulated with Blender's cloth. Made by
`benchmarks/known_motion.py`. Format and conventions are those of the recording of the same subject, whose body this
is{build};
the cameras are {cameras}; frames are {tone:g} times as bright as the clean plates.
"""


# --- motions ----------------------------------------------------------------------------------------------------------


def rotations_of(take: Take, body: Body, data: Path) -> tuple[np.ndarray, int]:
    """Return rotation vectors (T,J,3), the root's first, and how many frames of a run-up they begin with."""
    if script := SCRIPTS.get(take.motion):
        turn = script(body, np.arange(take.frames) / RATE)
        return np.stack([turn[name] for name in body.names], axis=1), 0
    file, before = np.load(data / "motions" / f"{take.motion}.npz"), min(take.start, RUN_UP)
    order = [list(file["joint_names"]).index(name) for name in body.names[1:]]
    whole = np.concatenate([file["root_rotation"][:, None], file["rotation_vectors"][:, order]], axis=1)
    if len(whole) < take.start + take.frames:
        raise SystemExit(f"{take.motion} has {len(whole)} frames; the take wants {take.start + take.frames}")
    return whole[take.start - before : take.start + take.frames].astype(float), before


def build_motion(take: Take, body: Body, data: Path, centre: np.ndarray, cameras: dict) -> tuple[Motion, int]:
    """Return the motion from the rest pose on, near a centre (2) of the floor, and the index of frame 0 in it."""
    rotations, before = rotations_of(take, body, data)
    main = ground(body, rotations, (take.flight[0] + before, take.flight[1] + before) if take.flight else None)
    main = _shifted(main, centre - main.translation[before:, :2].mean(0))
    main = _shifted(main, _into_view(skin(body, main, slice(None, None, 20))[before:].reshape(-1, 3), cameras))
    ease = np.concatenate([0.5 - 0.5 * np.cos(np.pi * np.arange(APPROACH) / APPROACH), np.ones(HOLD)])
    ways = [Slerp([0, 1], Rotation.from_rotvec([np.zeros(3), r])) for r in rotations[0]]
    lead = ground(body, np.stack([way(ease).as_rotvec() for way in ways], axis=1))
    stand = np.column_stack([np.tile(main.translation[0, :2], (len(ease), 1)), lead.translation[:, 2]])
    whole = Motion(np.vstack([stand, main.translation]), np.concatenate([lead.rotations, rotations]))
    return whole, len(ease) + before


def _shifted(motion: Motion, by: np.ndarray) -> Motion:
    return replace(motion, translation=motion.translation + [*by, 0])


def _into_view(points: np.ndarray, cameras: dict) -> np.ndarray:
    """Return the shift (2) on the floor, of a grid of 5 cm, by which points (N,3) leave the pictures least."""
    shifts = [np.array([x, y]) * 0.05 for x in range(-6, 7) for y in range(-6, 7)]
    return min(shifts, key=lambda s: beyond(points + [*s, 0], cameras) + 20 * np.linalg.norm(s))


def beyond(points: np.ndarray, cameras: dict, margin: float = 8.0) -> float:
    """Return by how many pixels, summed over cameras and sides, points (N,3) leave the pictures less a margin."""
    total = 0.0
    for camera in cameras.values():
        seen = points @ np.transpose(camera["turn"]) + camera["translation"]
        pixels = ((seen / seen[:, 2:]) @ np.array(camera["matrix"]).T)[:, :2]
        total += np.maximum(0, margin - pixels.min(0)).sum()
        total += np.maximum(0, pixels.max(0) + margin - camera["size"]).sum()
    return float(total)


# --- a recording ------------------------------------------------------------------------------------------------------


def prepare(take: Take, data: Path, out: Path) -> None:
    """Write cameras, subject, init.json and angles and joints of the truth, and work/scene.npz for Blender."""
    own, owners = (data / RECORDINGS[subject] for subject in (take.subject, OWNER[take.garment]))
    for folder in ("truth", "subject", "work", "background", "videos"):
        (out / folder).mkdir(parents=True, exist_ok=True)
    for file in ("cameras.toml", "subject/body.obj", "subject/skeleton.json", "subject/weights.npz"):
        shutil.copyfile(own / file, out / file)
    centre = np.load(own / "truth/joints.npz")["positions"][:, 0, :2].mean(0)
    if take.rig:
        (out / "cameras.toml").write_text(RIGS[take.rig](centre))
    cameras, body = tomllib.loads((out / "cameras.toml").read_text()), read_body(own / "subject")
    if take.build:
        body = built(body, BUILDS[take.build])
        write_body(body, own / "subject", out / "subject")
    del cameras["metadata"]
    for camera in cameras.values():
        camera["turn"] = Rotation.from_rotvec(camera["rotation"]).as_matrix().tolist()  # from world to camera
    measures = json.loads((owners / "subject/garment.json").read_text())
    if own != owners or take.build:
        measures = measures_for(body, measures, read_body(owners / "subject"))
    measures |= take.cut
    sleeves = [{"type": "cylinder", "joint": f"shoulder_{s}", **take.sleeves} for s in "lr" if take.sleeves]
    worn, plain = [measures, *sleeves], (SHIRT[take.subject], SHIRT[take.subject])
    (out / "subject/garment.json").write_text(json.dumps(worn if sleeves else measures, indent=1))
    whole, first = build_motion(take, body, data, centre, cameras)
    motion = Motion(whole.translation[first:], whole.rotations[first:])
    (out / "init.json").write_text(json.dumps(disturbed(body, motion, take.seed), indent=1))
    write_truth(body, chain(body, motion)[1], out / "truth")
    pieces = [sew(body, piece) for piece in worn]
    garment, looks = together(pieces), [take.stripes, *(plain for _ in sleeves)]
    colours = [np.where(p.stripe[:, None], *look) for p, look in zip(pieces, looks, strict=True)]
    touching = [np.full(len(p.vertices), of["type"] != "shorts") for p, of in zip(pieces, worn, strict=True)]
    np.savez(
        out / "work/scene.npz", first=first, plates=PLATES,
        room=json.dumps(asdict(take.place)), cameras=json.dumps(cameras),
        body=skin(body, whole).astype("f4"), faces=body.faces, paint=painted(body, take.subject),
        garment=np.concatenate([carried(body, p.vertices, p.pinned, whole) for p in pieces], axis=1).astype("f4"),
        quads=garment.quads, pinned=garment.pinned, cloth_paint=np.concatenate(colours),
        self_collision=np.concatenate(touching),
    )  # fmt: skip


def disturbed(body: Body, motion: Motion, seed: int) -> dict[str, object]:
    """Return init.json: the first pose with errors of 4 degrees and 2 cm a component."""
    random = np.random.default_rng(seed)
    off = Rotation.from_rotvec(random.normal(0, np.radians(4), (len(body.names), 3)))
    turned = (Rotation.from_rotvec(motion.rotations[0]) * off).as_rotvec().tolist()
    return {
        "root_rotation": turned[0],
        "root_translation": (motion.translation[0] + random.normal(0, 0.02, 3)).tolist(),
        "joint_rotations": dict(zip(body.names[1:], turned[1:], strict=True)),
    }


def write_truth(body: Body, positions: np.ndarray, folder: Path) -> None:
    """Write angles.csv and joints.npz."""
    table = angles(body, positions)
    rows, form = np.column_stack([np.arange(len(positions)), *table.values()]), "%d" + ",%.3f" * len(table)
    np.savetxt(folder / "angles.csv", rows, form, header=",".join(["frame", *table]), comments="")
    np.savez(folder / "joints.npz", positions=positions.astype("f4"), names=body.names, parents=body.parents)


def painted(body: Body, subject: str) -> np.ndarray:
    """Return colours (V,3): shirt, socks, hair, underwear and skin."""
    x, y, z = body.vertices.T
    shoulder, elbow, head = (body.joint(name) for name in ("shoulder_l", "elbow_l", "head"))
    sleeve = body.main("shoulder") & (np.abs(x) < 0.62 * elbow[0] + 0.38 * shoulder[0])
    sock = body.main("ankle", "toe") | (body.main("knee") & (z < body.joint("ankle_l")[2] + 0.07))
    scalp = (z > head[2] + 0.085) | ((y > head[1] + 0.045) & (z > head[2] + 0.02))
    colours = np.tile(SKIN, (len(z), 1))
    colours[body.main("pelvis", "spine", "chest") | sleeve] = SHIRT[subject]
    colours[z > body.joint("neck")[2] + 0.02] = SKIN
    colours[sock] = SOCKS[subject]
    colours[body.main("head", "neck") & scalp] = HAIR
    colours[body.main("hip") & (z > body.joint("hip_l")[2] - 0.12)] = UNDERWEAR
    return colours


def carried(body: Body, cloth: np.ndarray, pinned: np.ndarray, motion: Motion) -> np.ndarray:
    """Return cloth (T,C,3) moved rigidly as the skin next to its pinned band moves."""
    belt = cKDTree(body.vertices).query(cloth[pinned])[1]
    middle, result = body.vertices[belt].mean(0), []
    for places in skin(body, motion, belt):
        turn = Rotation.align_vectors(places - places.mean(0), body.vertices[belt] - middle)[0].as_matrix()
        result.append((cloth - middle) @ turn.T + places.mean(0))
    return np.stack(result)


def finish(take: Take, out: Path, room: Path) -> None:
    """Lay what was drawn around the person over empty rooms; write videos, clean plates and the true cloth."""
    quads, random = np.load(out / "work/scene.npz")["quads"], np.random.default_rng(take.seed)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype("i4")
    cloth, joints = np.load(out / "work/cloth.npy"), np.load(out / "truth/joints.npz")
    np.savez_compressed(out / "truth/cloth.npz", vertices=cloth, faces=faces)
    names, poses = list(joints["names"]), list(zip(cloth, joints["positions"], strict=True))
    for limb, parts in [("A leg", LEG), ("An arm", ARM)][: 1 + bool(take.sleeves)]:
        if wrong := sum(pierced(sheet, places, faces, names, parts) for sheet, places in poses):
            told = f"{limb} comes through the cloth in {wrong} of {len(cloth)} frames: the simulation has failed."
            (out / "README.md").write_text((out / "README.md").read_text() + "\n" + told + "\n")
            print(told)
    for camera, boxes in json.loads((out / "work/boxes.json").read_text()).items():
        empty = np.stack([cv2.imread(str(room / f"{camera}_{k}.png")) for k in range(PLATES)]).astype("f4")
        cv2.imwrite(str(out / f"background/{camera}.png"), _soft(empty.mean(0)).round().astype("u1"))
        pictures = []
        for frame, (x, y, w, h) in enumerate(boxes):
            picture, drawn = empty[frame % PLATES].copy(), cv2.imread(str(out / f"work/{camera}_{frame:06}.png"))
            weight = _fading([x, y, w, h], picture.shape)[..., None]
            picture[y : y + h, x : x + w] += weight * (drawn - picture[y : y + h, x : x + w])
            noisy = _soft(picture) * TONE + random.normal(0, NOISE, picture.shape)
            pictures.append(np.clip(noisy.round(), 0, 255).astype("u1"))
        write_video(out / f"videos/{camera}.mp4", np.stack(pictures))


def pierced(
    cloth: np.ndarray, positions: np.ndarray, faces: np.ndarray, names: list[str], parts: tuple[str, ...] = LEG
) -> bool:
    """Return whether a limb, as a line through its joint centres (J,3), passes through the cloth (C,3), as none can."""
    sheet = o3d.t.geometry.RaycastingScene()
    sheet.add_triangles(np.ascontiguousarray(cloth, "f4"), np.ascontiguousarray(faces, "u4"))
    limbs = [[positions[names.index(part + side)] for part in parts] for side in ("_l", "_r")]
    ways = np.array([[*a, *(b - a)] for limb in limbs for a, b in zip(limb, limb[1:], strict=False)])
    far = ways + np.pad(ways[:, 3:], ((0, 0), (0, 3)))  # from the lower end on
    counts = sheet.count_intersections(np.concatenate([ways, far]).astype("f4")).numpy()
    return bool((counts[: len(ways)] != counts[len(ways) :]).any())


def write_video(file: Path, pictures: np.ndarray) -> None:
    """Write pictures (T,H,W,3) as a video."""
    _, height, width, _ = pictures.shape
    source = f"-f rawvideo -pix_fmt bgr24 -s {width}x{height} -r {RATE:g} -i -"
    command = f"ffmpeg -v error -y {source} -c:v libx264 -crf 20 -pix_fmt yuv420p"
    subprocess.run([*command.split(), str(file)], input=pictures.tobytes(), check=True)


def _soft(picture: np.ndarray) -> np.ndarray:
    return cv2.GaussianBlur(picture, (0, 0), SOFTNESS_PX)


def _fading(box: list[int], shape: tuple[int, ...], margin: int = 12) -> np.ndarray:
    """Return weights (H,W) that fall to zero at the border of a box (x, y, width, height), except at the picture's."""
    (x, y, width, height), (rows, columns) = box, shape[:2]
    across, down = _ramp(width, x > 0, x + width < columns), _ramp(height, y > 0, y + height < rows)
    return np.clip(np.minimum(across, down[:, None]) / margin, 0, 1).astype("f4")


def _ramp(length: int, first: bool, last: bool) -> np.ndarray:
    """Return the distance to the ends of a line that count, 1 there."""
    along = np.arange(1.0, length + 1)
    return np.minimum(along if first else np.inf, along[::-1] if last else np.inf) * np.ones(length)


def main(name: str, data: Path, to: Path) -> None:
    """Make one take."""
    take = TAKES[name]
    out, room, script = to / name, to / take.plates, Path(__file__).parent / "known_motion_blender.py"
    prepare(take, data, out)
    cameras = f"the {take.rig} of `benchmarks/known_rigs.py`" if take.rig else "that recording's"
    build = f", made {take.build} by `benchmarks/known_people.py`" if take.build else ""
    (out / "README.md").write_text(
        ABOUT.format(name=name, take=take, rate=RATE, tone=TONE, cameras=cameras, build=build)
    )
    room.mkdir(exist_ok=True)
    blender = ["blender", "-b", "-t", "1", "--python-exit-code", "1", "-P", str(script), "--"]
    subprocess.run([*blender, str(out / "work"), str(room)], check=True)
    finish(take, out, room)
    shutil.rmtree(out / "work")


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3]))
