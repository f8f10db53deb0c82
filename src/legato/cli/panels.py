"""What `watch` shows of states, arm and contacts, as panels of rich; nothing is asked.

What is wrong is said in words and not by colour alone. Seconds are those of whoever looks.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from rich import box
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from legato.cli.live import Live
from legato.control.band import ACCEPTED, EXPECTED

SCALE = 25  # characters of a contact's scale, odd
REACHES = (0.5, 1.0, 2.0, 5.0, 10.0, 1e9)  # what a scale may span either way, mm
UNKNOWN = "-"


def states(live: Live, now: float) -> Panel:
    """Return the daemon's states, the present one lit, with how long each lasted."""
    table = Table.grid(padding=(0, 1), expand=True)
    table.add_column(no_wrap=True)
    table.add_column(justify="right", no_wrap=True)
    for name in live.states:
        if name == live.state:
            style = "bold white on red" if name == "fault" else "bold white on blue"
            table.add_row(
                Text(f"> {name}", style), Text(f"{live.upto(now) - live.since:.1f} s", "bold")
            )
        elif name in live.stays and name != "idle":
            table.add_row(Text(f"* {name}"), f"{live.stays[name]:.1f} s")
        else:
            table.add_row(Text(f"  {name}", "dim"), "")
    return boxed(table, "state" if live.pace is None or steady(live) else "state, wall seconds")


def arm(live: Live) -> Panel:
    """Return arm, camera and calibration, a line for each figure."""
    told, table = live.status.get("arm") or {}, _named()
    table.add_row("arm", _arm(told))
    place = told.get("xyz_mm") or (None, None, None)
    angles = (told.get("pitch_deg"), told.get("roll_deg"))
    table.add_row("x y z", " ".join(f"{_figure(v, '.1f'):>6}" for v in place) + " mm")
    table.add_row("pitch roll", " ".join(f"{_figure(v, '.1f'):>6}" for v in angles) + " deg")
    table.add_row("contact", _touching(told))
    table.add_row("doing", _doing(live))
    table.add_row("camera", _camera(live))
    calibration = live.status.get("calibration")
    table.add_row("calibration", _calibration(calibration))
    if calibration:
        table.add_row("", _figures(calibration))
    lease = live.status.get("lease")
    if lease:
        table.add_row("lease", str(lease.get("holder") or lease.get("by") or "held"))
    return boxed(table, "arm and camera")


def arm_in_short(live: Live) -> Panel:
    """Return the same in five lines, for a small terminal."""
    told, table = live.status.get("arm") or {}, _named()
    pitch, roll = (_figure(told.get(k), ".0f") for k in ("pitch_deg", "roll_deg"))
    place = " ".join(_figure(v, ".1f") for v in told.get("xyz_mm") or (None,) * 3)
    table.add_row("arm", Text.assemble(_arm(told), ", contact ", _touching(told)))
    table.add_row("x y z", f"{place} mm, pitch {pitch}, roll {roll} deg")
    table.add_row("doing", _doing(live))
    table.add_row("camera", _camera(live))
    calibration = live.status.get("calibration")
    figures = f", {_figures(calibration)}" if calibration else ""
    table.add_row("calibration", Text.assemble(_calibration(calibration), figures))
    return boxed(table, "arm and camera")


def contacts(live: Live) -> Panel:
    """Return each station's contacts: the last over the predicted surface, on a scale."""
    if not live.contacts:
        return boxed(Text("none in this session", "dim"), "contacts")
    bands = _bands(live)
    reach = _reach(live.contacts, bands)
    table = Table.grid(padding=(0, 1))
    for _ in range(4):
        table.add_column(no_wrap=True)
    head = f"-{reach:g}{'0':^{SCALE - 2 * len(f'{reach:g}') - 2}}+{reach:g}"
    table.add_row(*(Text(t, "dim") for t in ("station", "last mm", head, "n")))
    for station, heights in sorted(live.contacts.items()):
        scale = _scale(heights, reach, bands.get(station, {}))
        table.add_row(f"{station:g} mm", f"{heights[-1]:+.3f}", scale, str(len(heights)))
    rows: list[RenderableType] = [table]
    if bands:
        rows.append(Text(_legend(bands), "dim"))
    return boxed(Group(*rows), "contacts over the predicted surface")


def contact_rows(live: Live) -> int:
    """Return the rows that the contacts take, the frame with them and their legend last."""
    return 2 + (1 + len(live.contacts) + bool(_bands(live)) if live.contacts else 1)


def boxed(content: RenderableType, title: str) -> Panel:
    """Return content in the frame that all panels have."""
    return Panel(content, title=title, title_align="left", box=box.ROUNDED)


def steady(live: Live) -> bool:
    """Say whether the cell's clock is known to run as fast as the wall's."""
    return live.pace is not None and abs(live.pace - 1.0) < 0.02


def _named() -> Table:
    """Return a table of names and what they stand for."""
    table = Table.grid(padding=(0, 1))
    table.add_column(style="dim", no_wrap=True, min_width=len("calibration"))
    table.add_column(no_wrap=True, overflow="ellipsis")
    return table


def _bands(live: Live) -> dict[float, Mapping[str, Any]]:
    """Return each station's band, as status tells it."""
    told = (live.status.get("calibration") or {}).get("stations") or ()
    return {float(b["station_mm"]): b for b in told}


def _reach(
    touched: Mapping[float, Sequence[float]], bands: Mapping[float, Mapping[str, Any]]
) -> float:
    """Return how far the scale goes either way: over every touch and expected band, mm."""
    most = [abs(h) for heights in touched.values() for h in heights]
    most += [float(b.get("expected_mm") or 0.0) for b in bands.values()]
    return next(r for r in REACHES if r >= max(most) or r == REACHES[-1])


def _scale(heights: Sequence[float], reach: float, band: Mapping[str, Any]) -> Text:
    """Return the strokes of one station on a line of characters, the last one a full dot."""
    middle = SCALE // 2

    def cell(height: float) -> int:
        return min(max(round(middle + height / reach * middle), 0), SCALE - 1)

    line = ["."] * SCALE
    if expected := band.get("expected_mm"):
        for at in range(cell(-expected), cell(expected) + 1):
            line[at] = "="
    accepted = band.get("accepted_mm")
    if accepted and accepted <= reach:
        line[cell(-accepted)], line[cell(accepted)] = "[", "]"
    line[middle] = "|"
    for height in heights[:-1]:
        line[cell(height)] = "o"
    line[cell(heights[-1])] = "@"
    return Text("".join(line), "cyan")


def _legend(bands: Mapping[float, Mapping[str, Any]]) -> str:
    """Return what the signs on the scale stand for."""
    accepted = [float(b["accepted_mm"]) for b in bands.values() if b.get("accepted_mm")]
    limit = f"; [ ] {ACCEPTED}, \N{PLUS-MINUS SIGN} {max(accepted):g} mm" if accepted else ""
    return f"= {EXPECTED}{limit}"


def _arm(told: Mapping[str, Any]) -> Text:
    if not told.get("connected"):
        return Text("NOT CONNECTED", "bold red")
    if not told.get("referenced"):
        return Text("connected, NOT REFERENCED", "bold yellow")
    return Text("connected, referenced")


def _touching(told: Mapping[str, Any]) -> Text:
    return Text("YES", "bold white on red") if told.get("contact") else Text("no")


def _doing(live: Live) -> str:
    if live.state in ("idle", "fault"):
        return UNKNOWN
    at = f"at {live.station:g} mm" if live.station is not None else ""
    return " ".join(filter(None, (live.why, at))) or UNKNOWN


def _camera(live: Live) -> Text:
    told = live.status.get("camera") or {}
    if not told.get("connected"):
        return Text("NOT CONNECTED", "bold red")
    age, pace = told.get("age_s"), live.pace or (None if live.status.get("simulated") else 1.0)
    if age is None or pace is None:  # the age is the cell's, whose pace is not known yet
        return Text("connected")
    return Text(f"connected, picture {age / pace:.0f} s old")


def _calibration(told: Mapping[str, Any] | None) -> Text:
    if not told:
        return Text("none", "dim")
    if told.get("valid"):
        return Text("verified")
    return Text("NOT VERIFIED", "yellow")


def _figures(told: Mapping[str, Any]) -> str:
    rms, sigma = (_figure(told.get(k), ".3f") for k in ("rms_px", "sigma_mm"))
    return f"{rms} px, sigma {sigma} mm"


def _figure(value: Any, form: str) -> str:
    return format(value, form) if isinstance(value, int | float) else UNKNOWN
