"""What the page says, taken from a record: plain rows and sentences, nothing drawn.

Whatever a session never came to is None or empty; the template leaves it out.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from legato.calibration.problem import PAPER_BOUNDS
from legato.geometry.transforms import Array
from legato.records.chain import verify_chain
from legato.records.errors import RecordError
from legato.records.record import SessionRecord
from legato.report.clock import cell_seconds, moment, pace
from legato.report.devices import badge, cell, not_real
from legato.report.figures.curves import Stay
from legato.report.paper import TABLE_5_3
from legato.report.scene import Scene
from legato.report.strokes import LONGEST_MOVE_S, strokes_of

Row = dict[str, Any]
TONES = {"done": "good", "stopped": "calm", "refused": "warn", "fault": "bad", "interrupted": "bad"}
UNITS = {"f": "mm", "s_x": "px/mm", "s_y": "px/mm", "u0": "px", "v0": "px"} | dict.fromkeys(
    ("t_x", "t_y", "t_z"), "mm"
)
UNITLESS = dict.fromkeys(("noise", "suspects", "camera"), "chi-square")
APART = ("f", "s_x", "s_y")  # only f s_x = alpha_u and f s_y = alpha_v can be told
STOPPED = {
    "converged": "stopped because the pose had converged",
    "stalled": "stopped because the pose no longer changed",
    "generations": "stopped by their number",
}
PARTS = ("calibration", "truth", "trajectory", "frames")


def headline(record: SessionRecord) -> Row:
    """Return the outcome with its tone, the job, and how long it took."""
    outcome = record.meta.get("outcome")
    return {
        "outcome": outcome or "no outcome yet",
        "tone": TONES.get(str(outcome), "warn"),
        "job": record.meta.get("job", "unknown"),
        "reasons": [r for r in str(record.meta.get("reason") or "").split("; ") if r],
        "cause": record.meta.get("cause"),
        "simulated": bool(record.meta.get("simulated")),
        "badge": badge(record.meta),
        "cell": cell(record.meta),
        "no_real": not_real(record.meta),
        "seconds": duration(record),
        **clocks(record),
    }


def clocks(record: SessionRecord) -> Row:
    """Return how the cell's clock ran: `pace` as text and `cell_s`, None where it is the wall's."""
    rate = pace(record)
    other = rate != 1.0
    return {
        "pace": f"{rate:g}" if other else None,
        "cell_s": cell_seconds(record) if other else None,
        "seconds_of": "s of the cell" if other else "s",
    }


def duration(record: SessionRecord) -> float | None:
    """Return the wall seconds from request to end, None where either is unknown."""
    began, ended = (moment(record.meta.get(key)) for key in ("started", "ended"))
    return None if began is None or ended is None else (ended - began).total_seconds()


def warnings(record: SessionRecord) -> list[str]:
    """Return what makes this record less than a whole one, one sentence each."""
    for part in PARTS:
        getattr(record, part)  # reading it finds its damage
    found = []
    if record.torn:
        found.append(
            f"This record is torn: a crash broke it off after event {len(record.events)}. "
            "What follows is all that was written before."
        )
    if not record.finished:
        found.append(
            "This session has no outcome: it was still running when this page was made, "
            "or the daemon died under it."
        )
    try:
        chain = verify_chain(record.path)
        if not chain.ok:
            found.append(f"The event lines are not as they were written: {chain.text}.")
    except RecordError as error:
        found.append(f"The event lines cannot be verified: {error.text}.")
    return found + [f"A part of the record cannot be read: {d}." for d in record.damage]


def search(solved: Mapping[str, Any]) -> list[str]:
    """Return how the search went, in phrases."""
    found = [f"intrinsics {solved.get('intrinsics') or 'not told'}"]
    if solved.get("generations") is not None:
        why = str(solved.get("stopped_by"))
        found.append(f"{solved['generations']} generations, {STOPPED.get(why, why)}")
    # The paper's engine refines no candidates that could agree.
    if solved.get("agreement") is not None and solved.get("engine") != "paper":
        share = 100.0 * float(solved["agreement"])
        found.append(f"{share:.0f} % of the refined candidates agree on the optimum")
    if solved.get("seconds") is not None:
        found.append(f"{solved['seconds']:.2f} s of computing")
    return found


def refined_cost(solved: Mapping[str, Any]) -> float | None:
    """Return the cost of the residuals where it is below what the search ended with."""
    apart = [v for pair in (solved.get("residuals") or {}).values() for v in pair]
    trace = [v for v in (solved.get("trace") or {}).get("best") or () if v is not None]
    cost = float(np.sum(np.square(apart))) if apart else None
    return cost if cost is not None and trace and cost < 0.99 * trace[-1] else None


def residuals(solved: Mapping[str, Any]) -> list[Row]:
    """Return each mark: where it was seen, how far the pose misses it, or why it is missing."""
    apart = solved.get("residuals") or {}
    held = {h["name"]: h for h in solved.get("held_out") or ()}
    suspects = set(solved.get("suspects") or ())
    rows: list[Row] = []
    for name, (u, v) in (solved.get("marks") or {}).items():
        du, dv = apart.get(name) or (None, None)
        length = None if du is None or dv is None else float(np.hypot(du, dv))
        rows.append(
            {"name": name, "u": u, "v": v, "du": du, "dv": dv, "length": length,
             "held_out": held.get(name), "suspect": name in suspects, "missing": None}
        )  # fmt: skip
    missing = (solved.get("missing") or {}).items()
    return rows + [{"name": name, "missing": why} for name, why in missing]


def parameters(solved: Mapping[str, Any]) -> list[Row]:
    """Return the 11 genes beside their bounds and the paper's table 5.3.

    What a known camera gives has no bounds; its f, s_x and s_y have no values of their own, and
    alpha_u and alpha_v stand after them.
    """
    rows = []
    known = solved.get("intrinsics") == "known"
    for gene in solved.get("parameters") or ():
        name = gene["name"]
        low, high = (gene["low"], gene["high"]) if gene["searched"] else (None, None)
        share, own = None, False
        if low is not None and high is not None and high > low:
            share = float(np.clip((gene["value"] - low) / (high - low), 0.0, 1.0))
            own = name in PAPER_BOUNDS and not np.allclose(PAPER_BOUNDS[name], (low, high))
        rows.append(
            {
                **gene,
                "value": None if known and name in APART else gene["value"],
                "sigma": gene["sigma"] if gene["searched"] else None,
                "low": low,
                "high": high,
                "on_bound": gene["on_bound"] and gene["searched"],
                "unit": UNITS.get(name, "rad"),
                "share": share,
                "paper": TABLE_5_3.get(name),
                "own_bounds": own,
            }
        )
        if known and name == APART[-1]:
            rows += [_product(solved, alpha) for alpha in ("alpha_u", "alpha_v")]
    return rows


def checks(solved: Mapping[str, Any]) -> list[Row]:
    """Return the tests of verify; a limit without a unit is one of chi-square."""
    rows = [dict(check) for check in solved.get("checks") or ()]
    for row in rows:
        if not row.get("unit") and isinstance(row.get("limit"), int | float):
            row["unit"] = UNITLESS.get(str(row.get("name")), "")
    return rows


def _product(solved: Mapping[str, Any], name: str) -> Row:
    """Return the row of a known camera's focal length in px."""
    nothing = dict.fromkeys(("sigma", "low", "high", "share", "paper"))
    flags = {"on_bound": False, "own_bounds": False, "searched": False}
    return {"name": name, "value": solved.get(name), "unit": "px", **nothing, **flags}


def stays(record: SessionRecord) -> list[Stay]:
    """Return the stays in each state; the last one ends with the record's last event."""
    changes = record.of_kind("state")
    if not changes:
        return []
    zero, end = float(record.events[0]["t"]), float(record.events[-1]["t"])
    times = [float(e["t"]) - zero for e in changes] + [end - zero]
    names = [str(e["data"].get("state")) for e in changes]
    return [Stay(n, a, max(a, b)) for n, a, b in zip(names, times, times[1:], strict=False)]


def profiles(
    record: SessionRecord, solved: Mapping[str, Any]
) -> dict[float, list[tuple[Array, Array, Array]]]:
    """Return each stroke's times, heights over the predicted surface along its normal, and whys.

    Where the arm stood still between two rows, the height before is held up to the next motion.
    """
    surfaces = {float(s["station_mm"]): s for s in solved.get("stations") or ()}
    path, found = record.trajectory, {s: list[tuple[Array, Array, Array]]() for s in surfaces}
    places = np.stack([path[a] for a in "xyz"], axis=-1)
    for stroke in strokes_of(record):
        surface = surfaces.get(stroke.station)
        if surface is None:
            continue
        rows = slice(max(stroke.first - 1, 0), stroke.last + 1)
        offset = places[rows] - np.asarray(surface["place_mm"], dtype=float)
        height = offset @ np.asarray(surface["normal"], dtype=float)
        whys = path["why"][rows].copy()
        whys[0] = path["why"][stroke.first]  # the row before is where the stroke begins
        times = np.maximum(path["t"][rows] - stroke.began, 0.0)
        found[stroke.station].append(_held(times, height, whys))
    return {station: strokes for station, strokes in found.items() if strokes}


def _held(times: Array, heights: Array, whys: Array) -> tuple[Array, Array, Array]:
    """Insert a point before each motion that follows a rest."""
    rests = np.flatnonzero(np.diff(times) > 1.25 * LONGEST_MOVE_S) + 1
    return (
        np.insert(times, rests, times[rests] - LONGEST_MOVE_S),
        np.insert(heights, rests, heights[rests - 1]),
        np.insert(whys, rests, whys[rests - 1]),
    )


def settings(config: Mapping[str, Any]) -> list[tuple[str, list[tuple[str, str]]]]:
    """Return the configuration's tables as lines of key and value."""
    tables = {k: v for k, v in config.items() if isinstance(v, dict)}
    loose = {k: v for k, v in config.items() if not isinstance(v, dict)}
    whole = ({"": loose} if loose else {}) | tables
    return [(name, list(_lines(table))) for name, table in whole.items()]


def _lines(table: Mapping[str, Any], prefix: str = "") -> Iterable[tuple[str, str]]:
    """Yield keys, those of inner tables with a dot, and values as text."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _lines(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", told(value)


def told(value: Any) -> str:
    """Return a value of a configuration or of evidence as short text."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return "[" + ", ".join(told(v) for v in value) + "]"
    if isinstance(value, dict):
        return ", ".join(f"{k} {told(v)}" for k, v in value.items())
    if isinstance(value, bool):
        return "true" if value else "false"
    return "none" if value is None else str(value)


def no_overlay(record: SessionRecord) -> str:
    """Return why nothing is drawn over the picture."""
    if record.calibration:
        return "its size is not the calibration's"
    sought = any(e["data"].get("state") == "calibrate" for e in record.of_kind("state"))
    return "no pose was found in it" if sought else "no pose was found in it, as none was sought"


def picture_path(record: SessionRecord, scene: Scene | None) -> str | None:
    """Return the name of the picture to show: the one that was solved, else the last one taken."""
    named = str((record.calibration or {}).get("picture") or "") if scene is not None else ""
    frames = [f"frames/{f.name}" for f in record.frames]
    return named if named in frames else next(reversed(frames), None)
