"""The report of a session: one HTML file that needs nothing else, from whatever is recorded."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from legato.records.errors import told as told_error
from legato.records.files import make_folder, replace_file
from legato.records.record import SessionRecord
from legato.report import facts, happened
from legato.report.bands import bands_told, contact_bands, descent
from legato.report.clock import day
from legato.report.figures import canvas, closeups, curves, picture, space
from legato.report.paper import PLACEMENT_ERROR_MM, POSES
from legato.report.posed import pose_of, posed
from legato.report.scene import Scene, scene_of
from legato.report.score import score
from legato.report.touches import contacts, counted, ended_by

if TYPE_CHECKING:
    from jinja2 import Environment

TEMPLATE = "session.html.j2"
NOTHING = 1e-12
SAID = "not separately observable"  # the template says it beside the table


def write_report(record: SessionRecord, path: Path | None = None) -> Path:
    """Write the report of a session and return its path, by default report.html in its folder.

    Raises RecordError where the file cannot be written.
    """
    target = path if path is not None else record.path / "report.html"
    page = render(record)
    make_folder(target.parent)
    with told_error("write", target):
        replace_file(target, page.encode())
    return target


def render(record: SessionRecord) -> str:
    """Return the report as one HTML text."""
    return environment().get_template(TEMPLATE).render(**content(record))


def environment(**options: Any) -> "Environment":
    """Return where templates are found, with the filters that they share."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    made = Environment(
        loader=PackageLoader("legato.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        **options,
    )
    made.filters |= {"num": number, "told": facts.told, "figure_text": significant}
    made.filters |= {"day": shown_day, "beside": beside}
    return made


def content(record: SessionRecord) -> dict[str, Any]:
    """Return everything that the template shows, by name."""
    record = posed(record)
    solved, scene = record.calibration or {}, scene_of(record)
    touched = contacts(record)
    return {
        "id": record.id,
        "meta": record.meta,
        "head": facts.headline(record),
        "warnings": facts.warnings(record),
        "faults": happened.faults(record),
        "solved": solved,
        "search": facts.search(solved),
        "remarks": [w for w in solved.get("warnings") or () if SAID not in w],
        "residuals": facts.residuals(solved),
        "parameters": facts.parameters(solved),
        "checks": facts.checks(solved),
        "poses": POSES,
        "pose": pose_of(record),
        "contacts": touched,
        "bands_told": bands_told(contact_bands(record).values()),
        "no_overlay": facts.no_overlay(record),
        "strokes": len(counted(touched)),
        "ended_by": ended_by(record),
        "sigma": {s["station_mm"]: s.get("sigma_mm") for s in solved.get("stations") or ()},
        "score": score(record),
        "paper_error": PLACEMENT_ERROR_MM,
        "stays": facts.stays(record),
        "settings": facts.settings(record.meta.get("config") or {}),
        "events": happened.events(record),
        "event_count": len(record.events),
        "moves": int(record.trajectory["t"].size),
        **_pictures(record, scene),
        **_figures(record, scene),
    }


def _pictures(record: SessionRecord, scene: Scene | None) -> dict[str, Any]:
    """Return the camera's picture and what is laid over it."""
    shown: dict[str, Any] = {"picture": None, "picture_name": None, "marks": None, "scale": 1.0}
    shown |= {"way": None, "size": None, "close": None}
    name = facts.picture_path(record, scene)
    if name is not None:
        try:
            pixels = canvas.read_picture((record.path / name).read_bytes())
        except (OSError, ValueError, SyntaxError):  # what imread raises for a torn PNG
            return shown
        shown |= {"picture": canvas.jpeg(pixels), "picture_name": name, "size": pixels.shape[1::-1]}
        fits = scene is not None and shown["size"] == (
            scene.intrinsics.width, scene.intrinsics.height,
        )  # fmt: skip
        if scene is not None and fits:
            shown["marks"], shown["scale"] = picture.marks_overlay(scene, record.calibration or {})
            shown["close"] = closeups.marks(pixels, scene, record.calibration or {})
            if record.trajectory["t"].size:
                touched = contacts(record)
                shown["way"] = picture.trajectory_overlay(scene, record.trajectory, touched)
    return shown


def _figures(record: SessionRecord, scene: Scene | None) -> dict[str, str | None]:
    """Return each figure as a data URI, None where there is nothing to draw."""
    solved, touched, stays = record.calibration or {}, contacts(record), facts.stays(record)
    ended = ended_by(record)
    trace = solved.get("trace") or {}
    config = record.meta.get("config") or {}
    pressed, seconds = facts.profiles(record, solved), facts.clocks(record)["seconds_of"]
    true_pose = (record.truth or {}).get("world_from_object")
    return {
        "cost": curves.cost(trace["best"], trace.get("mean") or (), facts.refined_cost(solved))
        if trace.get("best")
        else None,
        "space": space.views(
            record.trajectory,
            scene,
            touched,
            None if true_pose is None else np.asarray(true_pose, dtype=float),
            float((config.get("cell") or {}).get("table_z_mm") or 0.0),
        )
        if record.trajectory["t"].size
        else None,
        "heights": curves.contact_heights(touched, contact_bands(record), descent(record), ended)
        if touched or ended
        else None,
        "press": curves.press_profiles(pressed, seconds) if pressed else None,
        "timeline": curves.timeline(stays) if stays else None,
    }


def significant(value: Any) -> str:
    """Return a figure of any size with three significant digits; what rounding leaves is 0."""
    if value is None:
        return "\N{EN DASH}"
    if abs(float(value)) < NOTHING:
        return "0"
    return f"{float(value):.3g}".replace("-", "\N{MINUS SIGN}")


def shown_day(wall: Any) -> str:
    """Return a time of a record with its date for people; what is no time as it stands."""
    return day(wall) or str(wall)


def beside(value: Any, sigma: Any) -> str:
    """Return a figure with as many decimals as its standard deviation `sigma` is worth."""
    known = sigma is not None and 0.0 < float(sigma) < 1.0
    decimals = int(-np.floor(np.log10(float(sigma)))) + 1 if known else 3
    return number(value, min(max(decimals, 3), 9))


def number(value: Any, decimals: int = 2, *, sign: bool = False) -> str:
    """Return a number for people: a true minus, an en dash for what is not known."""
    if value is None:
        return "\N{EN DASH}"
    text = f"{float(value):{'+' if sign else ''}.{decimals}f}"
    if float(text) == 0.0:
        text = text.lstrip("+-")
    return text.replace("-", "\N{MINUS SIGN}")
