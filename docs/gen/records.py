"""What a session's folder holds, file by file. A test holds this to a real session's record."""

from typing import Final

from docs.gen.tables import plain, table, words
from legato.records.trajectory import COLUMNS

FILES: Final[dict[str, str]] = {
    "session.json": "the request and its outcome, versions, configuration; written at the begin "
    "and replaced at the end",
    "events.jsonl": "what happened, one event a line, each with the hash of the line before",
    "effects.jsonl": "what the job asked for and was answered, one effect a line: what replaying "
    "a session works from",
    "start.json": "what the cell knew when the job began",
    "frames/": "every picture that was taken, as PNG",
    "calibration.json": "the pose, how it came about, and the tests that it was held to",
    "trajectory.csv": "a row for each motion command and reading",
    "truth.json": "simulated sessions only: what truly happened",
    "report.html": "made by `legato report`",
    "start.npz": "pictures and numbers that start.json refers to, where there are any",
}
SESSION: Final[dict[str, str]] = {
    "id": "the session; the folder's name",
    "job": "what was asked for",
    "params": "the request's parameters",
    "key": "the client's own key for the job, or null",
    "by": "who asked",
    "campaign": "the campaign that it belongs to, where it does",
    "started": "time of day, UTC",
    "ended": "time of day, UTC; null while it runs",
    "outcome": "`done`, `stopped`, `refused`, `fault` or `interrupted`; null while it runs",
    "reason": "why it ended so, or null",
    "cause": "the fault's cause, or null",
    "simulated": "whether the arm or the camera was none",
    "simulated_devices": "which of them: `arm`, `camera`",
    "boot": "the start of the daemon that it belongs to",
    "versions": "of legato, Python, numpy, OpenCV and what else took part",
    "config_hash": "hash of the configuration",
    "config": "the configuration, every key with its value",
    "intrinsics": "the camera's calibration that was used, or null",
    "seal": "number and last hash of the events, hashes of the other files and of this one's rest",
}
EVENT: Final[dict[str, str]] = {
    "seq": "number within the record, from 1",
    "wall": "time of day, UTC",
    "t": "the cell's clock, s",
    "kind": "the [topic](wire.md#events)",
    "data": "the event's own fields",
    "previous": "SHA-256 of the line before; empty in the first line",
}
CALIBRATION: Final[dict[str, str]] = {
    "accepted": "whether every test was passed",
    "reasons": "texts of the tests that were not",
    "engine": "`hybrid`, `paper` or `separable`",
    "intrinsics": "`known` from a file, or `free`: estimated from this picture",
    "marks": "the marks used and those left out, u and v in px",
    "missing": "the marks that were not found, with the reason",
    "left_out": "marks that the others contradict",
    "residuals": "predicted minus seen for each mark, px",
    "rms_px": "root mean square of the residuals",
    "camera_from_object": "the pose, 4x4, mm",
    "world_from_object": "the pose in the robot base frame, 4x4, mm",
    "world_from_camera": "where the camera stands, 4x4, mm, as configured",
    "alpha_u": "focal length along u, px",
    "alpha_v": "focal length along v, px",
    "u0": "principal point, px",
    "v0": "principal point, px",
    "k1": "radial distortion, second order",
    "k2": "radial distortion, fourth order",
    "width": "of the picture, px",
    "height": "of the picture, px",
    "parameters": "the eleven genes: value, bounds, standard deviation where one can be told",
    "sigma": "standard deviations: `rotation_deg`, `translation_mm`, `stations_mm`",
    "agreement": "share of the searches that ended in this pose",
    "held_out": "each mark as the others predict it",
    "suspects": "marks without which the fit would be sound",
    "suggest": "marks to use, marks to show as well, and why",
    "warnings": "what deserves a look",
    "trace": "best and mean cost by generation",
    "generations": "how many there were",
    "stopped_by": "`converged`, `stalled` or `generations`",
    "checks": "each test: name, figure, limit, unit, whether passed, text, hint",
    "stations": "each station: place, normal and standard deviation, robot base frame",
    "leg": "the leg model's measures and marks",
    "picture": "the picture that it was made from",
    "seconds": "how long finding and solving took",
}
TRAJECTORY: Final[dict[str, str]] = {
    "t": "the cell's clock, s",
    "commanded_1 to commanded_6": "absolute half-steps that were commanded; empty for a reading",
    "read_1 to read_6": "absolute half-steps by the registers",
    "t1, t2, t3, pitch, roll": "joints of the read-back, rad",
    "x, y, z": "fingertip of the read-back, robot base frame, mm",
    "contact": "1 while the grip switch is closed",
    "station_mm": "the station that is being massaged; empty elsewhere",
    "why": "transit, approach, descend, press, draw, retract; empty for a reading",
}
TRUTH: Final[dict[str, str]] = {
    "world_from_object": "where the leg truly lay",
    "world_from_camera": "where the camera truly stood",
    "touches": "each touch: place, time, force",
    "breaches": "commands that a real arm could not have followed, or should not have been sent",
    "tip": "where the fingertip truly stands",
    "registers": "the arm's registers",
    "lost_steps": "half-steps that each motor has lost",
}
HEAD = """\
# Records

Each session has a folder `state_dir/sessions/ID/`. Nothing accepted is ever without an outcome: a
session that a crash cut off is closed as `interrupted` by the next start, and read up to the tear.
`state_dir/state.json` holds what must survive a restart: the fault, the reference, the last
registers, and of which arm.

Each line of `events.jsonl` carries the hash of the line before, and `session.json` seals the
number of lines, the last hash and the hashes of the other files and of its own content. What it
said when the session began is hashed in the first `session` line too (`head`). `legato sessions
verify` finds a line or file that was changed, is missing or was added; only reports may be.
"""


def page() -> str:
    """Return the page."""
    named = {c.strip() for group in TRAJECTORY for c in _columns(group)}
    if named != set(COLUMNS):
        raise ValueError(f"trajectory.csv has other columns: {sorted(named ^ set(COLUMNS))}")
    parts = [HEAD, "## Files\n", _table("file", FILES)]
    for name, fields, text in (
        ("session.json", SESSION, ""),
        ("events.jsonl", EVENT, "One JSON object a line."),
        ("calibration.json", CALIBRATION, "The same document as `legato solve --json` prints."),
        ("trajectory.csv", TRAJECTORY, f"Columns in order: {words(COLUMNS)}."),
        ("truth.json", TRUTH, "What the simulated world wrote down. The daemon never sees it."),
    ):
        parts.append(f"## {name}\n\n{text}\n")
        parts.append(_table("field", fields))
    return "\n".join(parts)


def _table(head: str, rows: dict[str, str]) -> str:
    return table((head, "holds"), ((f"`{name}`", plain(text)) for name, text in rows.items()))


def _columns(group: str) -> list[str]:
    """Return the columns that a row of the table stands for."""
    first, _, last = group.partition(" to ")
    if not last:
        return group.split(",")
    stem = first.rpartition("_")[0]
    return [f"{stem}_{i}" for i in range(1, int(last.rpartition("_")[2]) + 1)]
