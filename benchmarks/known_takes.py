"""The takes that `known_motion.py` can make: who wears what and moves how."""

from __future__ import annotations

from dataclasses import dataclass, field

PURPLE = ((0.60, 0.40, 0.70), (0.32, 0.16, 0.42))  # of the stripes
GREY = ((0.45, 0.46, 0.50), (0.12, 0.13, 0.16))
GREEN = ((0.35, 0.62, 0.40), (0.10, 0.28, 0.16))
DARK = ((0.06, 0.06, 0.08), (0.06, 0.06, 0.08))  # plain
# m, measures of other cuts; what is not named is the owner's, scaled to the wearer
MAXI = {"length": 0.90, "hem_circumference": 2.1}
MINI = {"length": 0.42, "hem_circumference": 1.25}
WIDE = {"length": 0.60, "hem_circumference": 2.4}
CULOTTES = {"length": 0.68, "inseam": 0.44, "leg_opening_circumference": 0.66}
TROUSERS = {"length": 0.90, "inseam": 0.66, "leg_opening_circumference": 0.48}
SLACKS = {**TROUSERS, "length": 0.84, "inseam": 0.60}  # above a shorter wearer's ankles
# of a wide blouse: they end in the middle of the forearm
SLEEVES = {
    "A": {"start": 0.25, "upper_circumference": 0.34, "lower_circumference": 0.52, "length": 0.30},
    "B": {"start": 0.30, "upper_circumference": 0.38, "lower_circumference": 0.58, "length": 0.30},
}
WHOLE = 2000  # px, more than a picture: on a floor of one colour it shows where a picture was pasted in


@dataclass(frozen=True)
class Room:
    """Where a recording is made."""

    seed: int  # of the pictures on the walls and the boxes
    lamp: tuple[float, float, float]  # m, where it hangs
    wall: tuple[float, float, float]  # colour
    floor: tuple[float, float, float] = (0.50, 0.42, 0.32)
    boards: bool = True  # the floor's
    pad_px: int = 20  # around the person and the shadow, what is drawn anew in a frame


ROOMS = {
    "A": Room(ord("A"), (0.7, -0.6, 3.9), wall=(0.34, 0.37, 0.39)),
    "B": Room(ord("B"), (-0.6, -0.7, 3.9), wall=(0.34, 0.31, 0.28)),
    "studio": Room(
        ord("s"), (0.4, -1.0, 3.9), wall=(0.60, 0.60, 0.58), floor=(0.58, 0.58, 0.56), boards=False, pad_px=WHOLE
    ),
    "lab": Room(
        ord("l"), (-0.8, -0.2, 3.9), wall=(0.55, 0.56, 0.58), floor=(0.42, 0.43, 0.45), boards=False, pad_px=WHOLE
    ),
    "carpet": Room(ord("c"), (-0.9, 0.3, 3.9), (0.40, 0.30, 0.18), (0.30, 0.17, 0.11), boards=False),  # like skin
}


@dataclass(frozen=True)
class Take:
    """Who wears what and moves how: a file of DATA/motions from a frame on, or one of `SCRIPTS`."""

    subject: str
    garment: str
    motion: str
    seed: int  # of the errors of init.json and of the noise
    stripes: tuple[tuple[float, ...], tuple[float, ...]]
    start: int = 0
    frames: int = 50
    flight: tuple[int, int] | None = None  # frames of take-off and landing
    cut: dict[str, float] = field(default_factory=dict)  # m, measures in which the garment differs from its owner's
    sleeves: dict[str, float] = field(default_factory=dict)  # of the garment `cylinder`: share of the arm, and m
    room: str = ""  # one of `ROOMS`; if empty, the one that is named like the subject
    build: str = ""  # one of `known_people.BUILDS`; if empty, that of who was scanned
    rig: str = ""  # one of `known_rigs.RIGS`; if empty, the cameras of the subject's recording

    @property
    def place(self) -> Room:
        """The room."""
        return ROOMS[self.room or self.subject]

    @property
    def worn(self) -> str:
        """What is worn, in words."""
        return self.garment + (" and two sleeves" if self.sleeves else "")

    @property
    def plates(self) -> str:
        """The folder of the empty room, as the subject's cameras see it."""
        return "_".join(filter(None, ("room", self.subject, self.room, self.rig)))


TAKES = {
    "legcross_A_skirt": Take("A", "skirt", "legcross_A", 1, PURPLE, start=150),
    "squat_A_skirt": Take("A", "skirt", "kneebend_A", 2, GREEN, start=190),
    "squat_A_ring": Take("A", "skirt", "kneebend_A", 2, GREEN, start=190, rig="ring"),  # eight cameras
    "walk_B_skirt": Take("B", "skirt", "walk_B", 3, GREEN, start=100),
    "dance_A_shorts": Take("A", "shorts", "dance", 4, GREY),
    "kick_B_shorts": Take("B", "shorts", "kick_B", 5, GREY, frames=40),
    "legcross_B_shorts": Take("B", "shorts", "legcross_B", 6, GREEN, start=150),
    "jump_A_skirt": Take("A", "skirt", "jump_A", 7, PURPLE, start=14, frames=30, flight=(13, 24)),
    "squat_A_shorts": Take("A", "shorts", "squat", 8, GREEN),
    "dance_B_skirt": Take("B", "skirt", "dance", 9, PURPLE),
    "kneeup_A_skirt": Take("A", "skirt", "kneeup_A", 11, GREEN, start=5),
    # a foot leaves the pictures
    "kick_B_skirt": Take("B", "skirt", "kick_B", 12, PURPLE, start=120, frames=40),
    "walk_B_shorts": Take("B", "shorts", "walk_B", 13, PURPLE, start=200, frames=40),
    "legcross_B_skirt": Take("B", "skirt", "legcross_B", 14, GREEN, start=60, frames=40),
    "kneeup_B_dark": Take("B", "skirt", "kneeup_B", 21, DARK, start=200, frames=40),
    "squat_B_skirt": Take("B", "skirt", "kneebend_A", 32, GREEN, start=60, frames=80),
    "dance_A_skirt": Take("A", "skirt", "dance", 31, GREY, frames=100),
    "jump_A_shorts": Take("A", "shorts", "jump_A", 41, GREEN, start=14, frames=30, flight=(13, 24)),
    "kneeup_A_shorts": Take("A", "shorts", "kneeup_A", 42, PURPLE, start=40, frames=60),
    "walk_A_shorts": Take("A", "shorts", "walk_A", 43, GREY, start=60, frames=60),
    "legcross_A_skirt2": Take("A", "skirt", "legcross_A", 44, GREEN, start=20, frames=90),
    "kick_B_shorts2": Take("B", "shorts", "kick_B", 45, GREEN, start=60, frames=60),
    "kneeup_B_skirt": Take("B", "skirt", "kneeup_B", 46, GREY, start=60, frames=80),
    "legcross_B_skirt2": Take("B", "skirt", "legcross_B", 51, GREY, start=200, frames=60),
    "dance_B_shorts": Take("B", "shorts", "dance", 52, PURPLE, frames=60),
    "walk_A_skirt2": Take("A", "skirt", "walk_A", 53, DARK, start=220, frames=60),
    "lunge_A_skirt": Take("A", "skirt", "lunge", 54, GREEN, frames=60),
    "spin_B_skirt": Take("B", "skirt", "spin", 55, GREY, frames=60),
    "spin_A_skirt": Take("A", "skirt", "spin", 56, PURPLE, frames=60),
    "lunge_B_shorts": Take("B", "shorts", "lunge", 57, GREY, frames=60),
    "squat_B_shorts": Take("B", "shorts", "kneebend_A", 47, PURPLE, start=120, frames=60),
    "push_up_B_shorts": Take("B", "shorts", "push_up", 58, GREEN, frames=50),
    # other cuts than those of the shared recordings
    "walk_B_maxi": Take("B", "skirt", "walk_B", 61, PURPLE, start=40, cut=MAXI),
    "dance_A_mini": Take("A", "skirt", "dance", 62, GREY, cut=MINI),
    "kneeup_A_wide": Take("A", "skirt", "kneeup_A", 63, GREEN, start=60, cut=WIDE),
    "squat_A_maxi": Take("A", "skirt", "squat", 64, GREY, cut={"length": 0.86, "hem_circumference": 2.0}),
    "walk_A_culottes": Take("A", "shorts", "walk_A", 65, GREEN, start=120, cut=CULOTTES),
    "kneeup_B_culottes": Take("B", "shorts", "kneeup_B", 66, GREY, start=60, cut=CULOTTES),
    "walk_B_trousers": Take("B", "shorts", "walk_B", 67, PURPLE, start=60, cut=TROUSERS),
    "squat_A_trousers": Take("A", "shorts", "kneebend_A", 68, DARK, start=60, cut=SLACKS),
    "swing_A_skirt": Take("A", "skirt", "swing", 71, GREY, frames=60),
    "swing_B_shorts": Take("B", "shorts", "swing", 72, PURPLE, frames=60),
    "bow_B_skirt": Take("B", "skirt", "bow", 73, GREEN, frames=60),
    "bow_A_shorts": Take("A", "shorts", "bow", 74, GREY, frames=60),
    "kick_A_skirt": Take("A", "skirt", "kick_B", 75, GREEN, start=20, frames=50),
    "walk_B_skirt2": Take("B", "skirt", "walk_B", 76, PURPLE, start=20, frames=60),
    "run_A_skirt": Take("A", "skirt", "run", 81, GREEN),
    "run_B_skirt": Take("B", "skirt", "run", 82, GREY),
    "run_A_shorts": Take("A", "shorts", "run", 84, PURPLE),
    "jack_B_skirt": Take("B", "skirt", "jack", 83, PURPLE),
    "kneel_A_skirt": Take("A", "skirt", "kneel", 85, GREY, frames=60),
    "plie_A_skirt": Take("A", "skirt", "plie", 91, PURPLE),
    "grapevine_B_skirt": Take("B", "skirt", "grapevine", 92, DARK, frames=60),
    "sit_A_skirt": Take("A", "skirt", "sit", 101, GREEN, frames=60),
    "akimbo_B_shorts": Take("B", "shorts", "akimbo", 102, GREY),
    "kneel_B_skirt": Take("B", "skirt", "kneel", 111, GREEN, frames=60),
    "jack_A_skirt": Take("A", "skirt", "jack", 112, GREY),
    "walk_A_trousers": Take("A", "shorts", "walk_A", 113, GREY, start=20, cut=SLACKS),
    "swing_B_skirt": Take("B", "skirt", "swing", 131, GREEN, frames=60),
    "bow_A_skirt": Take("A", "skirt", "bow", 132, PURPLE, frames=60),
    "plie_B_shorts": Take("B", "shorts", "plie", 133, GREY),
    "scissors_B_shorts": Take("B", "shorts", "scissors", 141, PURPLE),
    "scissors_A_skirt": Take("A", "skirt", "scissors", 142, GREEN),
    "sit_B_skirt": Take("B", "skirt", "sit", 134, PURPLE, frames=60),
    # and a wide blouse's sleeves
    "dance_A_sleeves": Take("A", "skirt", "dance", 151, GREY, frames=40, sleeves=SLEEVES["A"]),
    "lunge_B_sleeves": Take("B", "shorts", "lunge", 152, PURPLE, frames=40, sleeves=SLEEVES["B"]),
    # people of another build
    "kneeup_A_heavy": Take("A", "skirt", "kneeup_A", 161, GREEN, start=5, build="heavy"),
    "squat_B_slim": Take("B", "shorts", "kneebend_A", 162, PURPLE, start=120, build="slim"),
    # other rooms: white, and of the colour of skin
    "walk_A_studio": Take("A", "skirt", "walk_A", 121, GREEN, start=150, frames=40, room="studio"),
    "kneeup_B_studio": Take("B", "shorts", "kneeup_B", 123, PURPLE, start=140, frames=24, room="studio"),
    "dance_A_lab": Take("A", "skirt", "dance", 124, GREY, frames=40, room="lab"),
    "lunge_A_studio": Take("A", "skirt", "lunge", 125, PURPLE, frames=40, room="studio"),
    "kneeup_B_carpet": Take("B", "shorts", "kneeup_B", 122, GREY, start=140, frames=40, room="carpet"),
}
