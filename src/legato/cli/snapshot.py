"""`legato snapshot`: pictures of the leg in many poses, to calibrate the camera with.

The simulated cell lays its leg elsewhere for each picture; at a real one a person does.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from legato.cli.command import Context, command
from legato.cli.exits import Exit, Failure
from legato.cli.numbers import Number

if TYPE_CHECKING:
    from legato.config.load import Loaded
    from legato.hal.camera import Camera, Image

SCATTER_MM = 15.0
SCATTER_DEG = 30.0


@command("snapshot")
@click.option(
    "--out", required=True, type=click.Path(file_okay=False, path_type=Path), help="Folder."
)
@click.option("--views", type=click.IntRange(min=1, max=1000), default=20, show_default=True)
@click.option("--seed", type=click.IntRange(min=0), default=1000, show_default=True)
@click.option("--scatter-mm", type=Number(min=0), default=SCATTER_MM, show_default=True)
@click.option(
    "--scatter-deg",
    type=Number(min=0, max=180),
    default=SCATTER_DEG,
    show_default=True,
    help="Largest random yaw; rise and roll a half of it.",
)
def snapshot(
    context: Context, out: Path, views: int, seed: int, scatter_mm: float, scatter_deg: float
) -> None:
    """Take pictures of the leg in many poses, for `legato intrinsics`.

    The simulated leg is laid anew for each, drawn by --seed and within the scatter about its
    configured pose. With a real camera you are asked to lay it anew.
    """
    from legato.config.load import load
    from legato.vision.picture import encode_png

    loaded = load(context.config, need_intrinsics=False)
    refuse_overwriting(out)
    out.mkdir(parents=True, exist_ok=True)
    files = []
    for number in range(1, views + 1):
        if loaded.config.camera.driver == "sim":
            image = simulated_view(loaded, seed + number - 1, scatter_mm, scatter_deg)
        else:
            click.prompt(
                f"picture {number} of {views}: lay the leg anew, then press Enter",
                default="", show_default=False, prompt_suffix="", err=True,
            )  # fmt: skip
            image = real_view(loaded)
        file = out / f"view-{number:03d}.png"
        file.write_bytes(encode_png(image))
        files.append(str(file))
        context.output.note(str(file))
    context.output.document({"files": files})


def refuse_overwriting(folder: Path) -> None:
    """Raise Failure where a folder has pictures of an earlier snapshot."""
    there = sorted(folder.glob("view-*.png"))
    if there:
        text = f"{folder} has {len(there)} pictures already, such as {there[0].name}"
        raise Failure(text, Exit.USAGE, "name another folder with --out, or move them away")


def simulated_view(loaded: "Loaded", seed: int, scatter_mm: float, scatter_deg: float) -> "Image":
    """Return a picture of a simulated cell that differs by its seed and scatter alone."""
    from dataclasses import replace

    from msgspec import structs

    sim = structs.replace(
        loaded.config.sim,
        seed=seed,
        scatter_mm=scatter_mm,
        scatter_deg=scatter_deg,
        time_scale=1000.0,
    )
    return real_view(replace(loaded, config=structs.replace(loaded.config, sim=sim)))


def real_view(loaded: "Loaded") -> "Image":
    """Return one picture of the configured camera."""
    from legato.daemon.cell import build_cell

    camera: Camera = build_cell(loaded).camera
    camera.open()
    try:
        image = camera.grab().image
    finally:
        camera.close()
    if image.size == 0:
        raise Failure("the camera gave an empty picture", Exit.FAILED)
    return image
