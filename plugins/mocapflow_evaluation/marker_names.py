"""What laboratories call the markers on bony landmarks."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from mocapflow.errors import RecordingError, alternatives
from mocapflow.io.json_toml import place, read_toml

# Landmark: its marker in Plug-in Gait and CGM2, CAST (van Sint Jan), OpenSim's gait models, OpenCap; s is the side.
KNOWN: Mapping[str, tuple[str, ...]] = {
    "asis": ("sASI", "s_IAS", "s.ASIS", "s.ASIS_study"),
    "psis": ("sPSI", "s_IPS", "s.PSIS", "s.PSIS_study"),
    "knee_lateral": ("sKNE", "s_FLE", "s.Knee.Lat", "s_knee_study"),
    "knee_medial": ("sKNM", "s_FME", "s.Knee.Med", "s_mknee_study"),
    "ankle_lateral": ("sANK", "s_FAL", "s.Ankle.Lat", "s_ankle_study"),
    "ankle_medial": ("sMED", "s_TAM", "s.Ankle.Med", "s_mankle_study"),
    "toe": ("sTOE", "s_FM2", "s.Toe.Tip", "s_toe_study"),
    "heel": ("sHEE", "s_FCC", "s.Heel", "s_calc_study"),
    "acromion": ("sSHO", "s_SAE", "s.Acromium", "s_shoulder_study"),
    "elbow_lateral": ("sELB", "s_HLE", "s.Elbow.Lat", "s_lelbow_study"),
    "elbow_medial": ("sELBM", "s_HME", "s.Elbow.Med", "s_melbow_study"),
    "wrist_lateral": ("sWRA", "s_RSP", "s.Wrist.Lat", "s_lwrist_study"),
    "wrist_medial": ("sWRB", "s_USP", "s.Wrist.Med", "s_mwrist_study"),
}
LANDMARKS = tuple(f"{name}_{side}" for name in KNOWN for side in ("l", "r"))
NOBODY = ""  # subject of a marker that says none
FILE = "markers.toml"  # beside the reference: landmark = "name of the marker"


def landmarks(labels: Sequence[str], folder: Path, others: Sequence[str] = ()) -> dict[str, int]:
    """Return which marker shows which landmark: by markers.toml in the folder, else by the names that are known.

    Args:
        labels: of the markers in a file.
        folder: where it lies.
        others: of those in another file there, which markers.toml may name too.

    Raises:
        RecordingError: markers.toml can't be read, or names a landmark or a marker that is not there; without one,
            there are known names of more than one subject.
    """
    told = _told(labels, folder / FILE, others)
    plain = {_plain(label): index for index, label in reversed(list(enumerate(labels)))}
    found, subjects = {}, set()
    for name, patterns in KNOWN.items():
        for side in ("l", "r"):
            spelled = [_plain(re.sub("^s", side, pattern)) for pattern in patterns]
            whose = {_subject(label) for label in labels if _plain(label) in spelled}
            subjects |= whose if len(whose) > 1 else whose - {NOBODY}  # it may be anybody's, if nobody else has it
            index = next((plain[each] for each in spelled if each in plain), None)
            if index is not None:
                found[f"{name}_{side}"] = index
    if len(subjects) > 1 and not told:
        named = ", ".join(sorted(name or "one without a name" for name in subjects))
        what = f"there are markers of {len(subjects)} subjects: {named}"
        hint = 'export one of them, or name the markers of one in this file: knee_lateral_l = "…"'
        raise RecordingError(what, where=str(folder / FILE), hint=hint)
    return told if len(subjects) > 1 else found | told


def _told(labels: Sequence[str], path: Path, others: Sequence[str]) -> dict[str, int]:
    if not path.is_file():
        return {}
    told = read_toml(path, 'expected lines as knee_medial_l = "LMK"')
    for landmark, label in told.items():
        if landmark not in LANDMARKS:
            raise RecordingError(
                f"unknown landmark '{landmark}'", where=place(path, landmark), hint=alternatives(landmark, LANDMARKS)
            )
        if label not in labels and label not in others:
            raise RecordingError(
                f"no marker '{label}'", where=place(path, landmark), hint=alternatives(str(label), labels)
            )
    return {landmark: list(labels).index(label) for landmark, label in told.items() if label in labels}


def _subject(label: str) -> str:
    return label.rpartition(":")[0]


def _plain(label: str) -> str:
    """Return a name without the subject before a colon, case, and what stands between words."""
    return re.sub(r"[\s._-]", "", label.rpartition(":")[2]).lower()
