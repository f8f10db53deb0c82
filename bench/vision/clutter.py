"""What lies about the leg or before it: checkers, covers, reflections, another leg."""

import cv2
import numpy as np

from bench.vision.scenes import Sharp, Truth, camera_from_world, in_sight, true_camera
from bench.vision.spoil import Cover, Glare, cover_over
from legato.geometry.projection import project
from legato.geometry.raycast import cast
from legato.geometry.transforms import Array, apply, invert


def with_checkers(scene: Sharp, rng: np.random.Generator, count: int) -> Sharp:
    """Return a scene with so many turned, slanted 2x2 checkers and boards painted on it."""
    out = scene.copy()
    h, w = scene.shape
    for _ in range(count):
        n = 2 if rng.random() < 0.8 else int(rng.integers(3, 7))
        side = int(rng.integers(6, 20))
        board = (np.indices((n, n)).sum(axis=0) % 2).astype(np.float32)
        low, high = sorted(rng.uniform(0.05, 0.95, 2))
        board = np.kron(low + (high - low) * board, np.ones((side, side), dtype=np.float32))
        turn = rng.uniform(0.0, 2.0 * np.pi)
        shape = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        shape = shape @ np.diag([1.0, rng.uniform(0.4, 1.0)])
        at = rng.uniform([0.0, 0.0], [w, h]) - shape @ [n * side / 2, n * side / 2]
        matrix = np.concatenate([shape, at[:, None]], axis=1)
        share = cv2.warpAffine(np.ones_like(board), matrix, (w, h))
        out += share * (cv2.warpAffine(board, matrix, (w, h)) / np.maximum(share, 1e-6) - out)
    return out


def hiding(truth: Truth, rng: np.random.Generator, count: int) -> tuple[Cover, ...]:
    """Return covers over so many of the marks in sight, P1 or P8 left."""
    while True:
        names = [str(n) for n in rng.permutation(list(mark_pixels(truth)))[:count]]
        if _sound_left(truth, names):
            pixels = mark_pixels(truth)
            return tuple(cover_over(pixels[n], 1.6 * mark_reach(truth, n), rng) for n in names)


def reflections(truth: Truth, rng: np.random.Generator, count: int) -> tuple[Glare, ...]:
    """Return reflections near so many of the marks in sight."""
    pixels = mark_pixels(truth)
    names = [str(n) for n in rng.permutation(list(pixels))[:count]]
    # A leg that shows neither of its faces has no such mark to leave.
    while count < 4 and _sound_left(truth, []) and not _sound_left(truth, names):
        names = [str(n) for n in rng.permutation(list(pixels))[:count]]
    return tuple(
        Glare(pixels[n] + rng.normal(0.0, 12.0, 2), rng.uniform(6.0, 40.0), rng.uniform(0.1, 1.5))
        for n in names
    )


def _sound_left(truth: Truth, hidden: list[str]) -> bool:
    """Say whether without the hidden marks one is left that lies off the plane of the others."""
    seen = in_sight(truth, true_camera())
    return bool({"P1", "P8"} & set(seen) - set(hidden))


def covers_over(truth: Truth, rng: np.random.Generator, whole: int, part: int) -> tuple[Cover, ...]:
    """Return covers over so many marks in whole and so many in part."""
    pixels = mark_pixels(truth)
    names = rng.permutation(list(pixels))
    size = {n: mark_reach(truth, n) for n in pixels}
    covers = [cover_over(pixels[n], 1.6 * size[n], rng) for n in names[:whole]]
    covers += [
        cover_over(pixels[n], rng.uniform(0.3, 1.0) * size[n], rng, rng.uniform(0.2, 1.5) * size[n])
        for n in names[whole : whole + part]
    ]
    return tuple(covers)


def mark_pixels(truth: Truth) -> dict[str, Array]:
    """Return where the marks in sight lie in the true picture."""
    camera = true_camera()
    pose = camera_from_world() @ truth.world_from_object
    names = in_sight(truth, camera, 4.0)
    if not names:
        return {}
    return dict(zip(names, project(camera, pose, truth.leg.points(tuple(names))), strict=True))


def mark_reach(truth: Truth, name: str) -> float:
    """Return half a mark's diagonal in the picture, px."""
    pose = camera_from_world() @ truth.world_from_object
    depth = (pose[:3, :3] @ truth.leg.marks[name] + pose[:3, 3])[2]
    return float(true_camera().alpha_u / depth * truth.leg.mark_size * 0.71)


def left_in_sight(truth: Truth, covers: tuple[Cover, ...], near: Truth) -> list[str]:
    """Return the marks of a leg that neither a cover nor the nearer leg hides."""
    left = []
    for name, pixel in mark_pixels(truth).items():
        polygons = (c.corners.astype(np.float32) for c in covers)
        if any(cv2.pointPolygonTest(p, [float(x) for x in pixel], False) >= 0 for p in polygons):
            continue
        if near is not truth:
            near_from_world = invert(near.world_from_object)
            eye = apply(near_from_world, invert(camera_from_world())[None, :3, 3])
            pose = near_from_world @ truth.world_from_object
            place = apply(pose, np.array([truth.leg.marks[name]]))
            distance = float(cast(near.leg, eye, place - eye).distance[0])
            if distance < 1.0:
                continue
        left.append(name)
    return left
