"""How many pictures of which kind are drawn.

`UNKNOWABLE` holds what no check of one camera's pictures can tell: a leg of another size with all
that is on it, and a camera that was moved before the first picture.
"""

from collections.abc import Mapping

from bench.vision import adversaries, changed
from bench.vision.cases import Draw

FAIR: Mapping[str, tuple[Draw, int]] = {
    "fair": (adversaries.fair, 350),
    "fair, varied": (adversaries.fair_varied, 170),
}
KINDS: Mapping[str, tuple[Draw, int]] = {
    "hidden marks": (adversaries.hidden, 150),
    "marks covered in part": (adversaries.covered_in_part, 100),
    "glare": (adversaries.glare, 80),
    "misplaced marks": (adversaries.misplaced, 120),
    "sloppily pasted marks": (adversaries.sloppy, 60),
    "slipped sheets of marks": (adversaries.slipped, 80),
    "other cone": (adversaries.other_cone, 80),
    "other size, marks as printed": (adversaries.scaled_leg, 120),
    "flipped pictures": (adversaries.mirrored, 50),
    "face marks misplaced": (adversaries.one_mark_elsewhere, 60),
    "second leg": (adversaries.second_leg, 100),
    "no leg": (adversaries.no_leg, 60),
    "bad exposure": (adversaries.bad_exposure, 60),
    "out of focus": (adversaries.out_of_focus, 60),
    "motion blur": (adversaries.motion_blur, 50),
    "JPEG": (adversaries.compressed, 40),
    "wrong intrinsics": (changed.wrong_camera, 120),
    "intrinsics a little wrong": (changed.wrong_camera_little, 120),
    "wrong intrinsics, hidden marks": (changed.wrong_camera_hidden, 60),
    "wrong intrinsics, spoilt picture": (changed.wrong_camera_spoilt, 60),
    "free intrinsics": (changed.free_camera, 50),
    "swapped picks": (changed.swapped_picks, 120),
    "leg moved between": (changed.moved_between, 120),
    "camera bumped between": (changed.camera_bumped_between, 50),
    "intrinsics wrong by 5 %": (changed.wrong_camera_five, 100),
    "far other size, marks too": (adversaries.scaled_far_with_marks, 80),
}
UNKNOWABLE: Mapping[str, tuple[Draw, int]] = {
    "other size, marks too": (adversaries.scaled_with_marks, 30),
    "camera bumped before": (changed.camera_bumped_before, 30),
}
