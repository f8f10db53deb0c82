"""How many pictures of which kind are drawn.

`UNKNOWABLE` holds what no check of one camera's pictures can tell: a leg of another size with all
that is on it, and a camera that was moved before the first picture.
"""

from collections.abc import Mapping

from bench.vision import adversaries, changed
from bench.vision.cases import Draw

FAIR: Mapping[str, tuple[Draw, int]] = {
    "fair": (adversaries.fair, 400),
    "fair, varied": (adversaries.fair_varied, 200),
}
KINDS: Mapping[str, tuple[Draw, int]] = {
    "hidden marks": (adversaries.hidden, 180),
    "marks covered in part": (adversaries.covered_in_part, 120),
    "glare": (adversaries.glare, 100),
    "misplaced marks": (adversaries.misplaced, 150),
    "sloppily pasted marks": (adversaries.sloppy, 80),
    "slipped sheets of marks": (adversaries.slipped, 100),
    "other cone": (adversaries.other_cone, 100),
    "other size, marks as printed": (adversaries.scaled_leg, 150),
    "flipped pictures": (adversaries.mirrored, 60),
    "face marks misplaced": (adversaries.one_mark_elsewhere, 80),
    "second leg": (adversaries.second_leg, 120),
    "no leg": (adversaries.no_leg, 80),
    "bad exposure": (adversaries.bad_exposure, 80),
    "out of focus": (adversaries.out_of_focus, 80),
    "motion blur": (adversaries.motion_blur, 60),
    "JPEG": (adversaries.compressed, 50),
    "wrong intrinsics": (changed.wrong_camera, 160),
    "intrinsics a little wrong": (changed.wrong_camera_little, 120),
    "wrong intrinsics, hidden marks": (changed.wrong_camera_hidden, 60),
    "wrong intrinsics, spoilt picture": (changed.wrong_camera_spoilt, 60),
    "free intrinsics": (changed.free_camera, 60),
    "swapped picks": (changed.swapped_picks, 100),
    "leg moved between": (changed.moved_between, 160),
    "camera bumped between": (changed.camera_bumped_between, 60),
}
UNKNOWABLE: Mapping[str, tuple[Draw, int]] = {
    "other size, marks too": (adversaries.scaled_with_marks, 60),
    "camera bumped before": (changed.camera_bumped_before, 60),
}
