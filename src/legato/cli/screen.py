"""The live view drawn for a terminal: panels of rich, from what `Live` knows; nothing is asked.

What is wrong is said in words and not by colour alone.
"""

import time
from collections.abc import Mapping
from typing import Any

from rich import box
from rich.console import Group, RenderableType
from rich.layout import Layout
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from legato.cli.live import Live

NARROW = 112  # columns; below them panels stand under each other
SCALE = 25  # characters of a contact's scale, odd
TONES = {"fault": "red", "contact": "cyan", "session": "green", "link": "magenta", "state": "blue"}
UNKNOWN = "-"


def screen(live: Live, now: float, width: int, height: int) -> Layout:
    """Return the whole view for a terminal of so many columns and rows."""
    fault, upper = live.status.get("fault"), 2 + max(len(live.states), 9)
    layout = Layout()
    parts = [Layout(banner(live, now), size=3)]
    if fault and live.state == "fault":
        parts.append(Layout(fault_panel(fault), size=fault_rows(fault, width)))
    places = [
        Layout(states(live, now), size=26),
        Layout(arm(live), ratio=1),
        Layout(contacts(live), size=SCALE + 24),
    ]
    middle = Layout(size=upper)
    if width < NARROW:
        places = [Layout(arm(live), size=11), Layout(contacts(live))]
        middle = Layout(size=min(18, max(height - 10, 8)))
        middle.split_column(*places)
    else:
        middle.split_row(*places)
    parts += [middle, Layout(progress(live), size=3), Layout(events(live, now, height))]
    layout.split_column(*parts)
    return layout


def banner(live: Live, now: float) -> RenderableType:
    """Return the line that tells state, link and cell at a glance."""
    link = live.link(now)
    words = Text(no_wrap=True, overflow="ellipsis")
    if live.status.get("simulated"):
        words.append(" SIMULATED ", "bold black on yellow")
        words.append(" ")
    if link == "lost":
        since = now - live.lost_at if live.lost_at is not None else 0.0
        words.append(f" CONNECTION LOST {since:.0f} s, trying again ", "bold white on red")
        words.append(f"  last known: {live.state or 'nothing'}")
    elif link == "stale":
        words.append(f" STALE: nothing heard for {live.silent_s(now):.0f} s ", "bold white on red")
        words.append(f"  last known: {live.state}")
    else:
        style = "bold white on red" if live.state == "fault" else "bold white on blue"
        words.append(f" {live.state} ", style)
        words.append(f" {now - live.since:.0f} s")
        if live.session and live.state != "idle":
            words.append(f"   session {live.session}")
        elif live.ended:
            words.append(f"   last: {live.ended.get('job')} {live.ended.get('outcome')}")
    tone = {"live": "red" if live.state == "fault" else "blue"}.get(link, "red")
    where = f"legato {live.status.get('version') or ''} at {live.endpoint}"
    return Panel(words, box=box.HEAVY, border_style=tone, title=where, title_align="left",
                 subtitle="Ctrl-C leaves; `legato stop` stops", subtitle_align="right")  # fmt: skip


def states(live: Live, now: float) -> RenderableType:
    """Return the daemon's states, the present one lit, with how long each lasted."""
    table = Table.grid(padding=(0, 1), expand=True)
    table.add_column(no_wrap=True)
    table.add_column(justify="right", no_wrap=True)
    for name in live.states:
        if name == live.state:
            style = "bold white on red" if name == "fault" else "bold white on blue"
            table.add_row(Text(f"> {name}", style), Text(f"{now - live.since:.1f} s", "bold"))
        elif name in live.stays and name != "idle":
            table.add_row(Text(f"* {name}"), f"{live.stays[name]:.1f} s")
        else:
            table.add_row(Text(f"  {name}", "dim"), "")
    return Panel(table, title="state", title_align="left", box=box.ROUNDED)


def arm(live: Live) -> RenderableType:
    """Return arm, camera and calibration."""
    told = live.status.get("arm") or {}
    place = told.get("xyz_mm") or (None, None, None)
    table = Table.grid(padding=(0, 1))
    table.add_column(style="dim", no_wrap=True, min_width=len("calibration"))
    table.add_column(no_wrap=True, overflow="ellipsis")
    table.add_row("arm", _arm(told))
    table.add_row("x y z", " ".join(f"{_figure(v, '.1f'):>6}" for v in place) + " mm")
    angles = [told.get("pitch_deg"), told.get("roll_deg")]
    table.add_row("pitch roll", " ".join(f"{_figure(v, '.1f'):>6}" for v in angles) + " deg")
    touching = Text("YES", "bold white on red") if told.get("contact") else Text("no")
    table.add_row("contact", touching)
    resting = live.state in ("idle", "fault")
    doing = UNKNOWN if resting else live.why or UNKNOWN
    at = f" at {live.station:g} mm" if live.station is not None and not resting else ""
    table.add_row("doing", f"{doing}{at}")
    table.add_row("camera", _camera(live.status.get("camera") or {}))
    calibration = live.status.get("calibration")
    table.add_row("calibration", _calibration(calibration))
    if calibration:
        rms, sigma = (_figure(calibration.get(k), ".3f") for k in ("rms_px", "sigma_mm"))
        table.add_row("", f"{rms} px, sigma {sigma} mm")
    lease = live.status.get("lease")
    if lease:
        table.add_row("lease", str(lease.get("holder") or lease.get("by") or "held"))
    return Panel(table, title="arm and camera", title_align="left", box=box.ROUNDED)


def contacts(live: Live) -> RenderableType:
    """Return each station's contacts: the last over the predicted surface, on a scale."""
    if not live.contacts:
        return Panel(Text("none in this session", "dim"), title="contacts", title_align="left",
                     box=box.ROUNDED)  # fmt: skip
    sigma = (live.status.get("calibration") or {}).get("sigma_mm")
    most = max(abs(h) for heights in live.contacts.values() for h in heights)
    reach = next(r for r in (0.5, 1.0, 2.0, 5.0, 10.0, 1e9) if r >= max(most, 2 * (sigma or 0.0)))
    table = Table.grid(padding=(0, 1))
    for _ in range(4):
        table.add_column(no_wrap=True)
    head = f"-{reach:g}{'0':^{SCALE - 2 * len(f'{reach:g}') - 2}}+{reach:g}"
    table.add_row(*(Text(t, "dim") for t in ("station", "last mm", head, "n")))
    for station, heights in sorted(live.contacts.items()):
        last = heights[-1]
        scale = _scale(heights, reach, sigma)
        table.add_row(f"{station:g} mm", f"{last:+.3f}", scale, str(len(heights)))
    note = "over the predicted surface; = is 2 sigma of the worst station" if sigma else ""
    return Panel(Group(table, Text(note, "dim")), title="contacts", title_align="left",
                 box=box.ROUNDED)  # fmt: skip


def progress(live: Live) -> RenderableType:
    """Return how far the session is."""
    done, total = live.progress.get("done"), live.progress.get("total")
    table = Table.grid(padding=(0, 1), expand=True)
    table.add_column(ratio=2, no_wrap=True, overflow="ellipsis")
    table.add_column(ratio=3)
    table.add_column(justify="right", no_wrap=True)
    text = str(live.progress.get("text") or "")
    if live.state == "idle" and live.ended:
        reason = f": {live.ended['reason']}" if live.ended.get("reason") else ""
        text = f"{live.ended.get('job')} {live.ended.get('outcome')}{reason}"
    bar = ProgressBar(total=total, completed=done or 0) if total else ""
    table.add_row(Text(text), bar, f"{done}/{total}" if total else "")
    return Panel(table, title="progress", title_align="left", box=box.ROUNDED)


def events(live: Live, now: float, height: int) -> RenderableType:
    """Return the last events, the newest first."""
    table = Table.grid(padding=(0, 1))
    table.add_column(style="dim", no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True, overflow="ellipsis")
    wall = time.time() - now  # shown to people only
    for moment, topic, text in list(live.said)[::-1][: max(height, 1)]:
        clock = time.strftime("%H:%M:%S", time.localtime(wall + moment))
        table.add_row(clock, Text(topic, TONES.get(topic, "")), Text(text))
    return Panel(table, title="last events, newest first", title_align="left", box=box.ROUNDED)


def fault_panel(fault: Mapping[str, Any]) -> RenderableType:
    """Return the fault with what to do."""
    words = Text(str(fault.get("text") or ""), "bold")
    if fault.get("hint"):
        words.append(f"\nwhat to do: {fault['hint']}", "not bold")
    words.append("\nthen: legato reset", "dim not bold")
    return Panel(words, title=f"FAULT {fault.get('cause')}", title_align="left", box=box.HEAVY,
                 border_style="bold red")  # fmt: skip


def fault_rows(fault: Mapping[str, Any], width: int) -> int:
    """Return the rows that a fault takes at a width, its frame and last line with it."""
    said = [str(fault.get("text") or ""), f"what to do: {fault.get('hint') or ''}"]
    return 3 + sum(-(-len(words) // max(width - 4, 1)) for words in said)


def _scale(heights: list[float], reach: float, sigma: float | None) -> Text:
    """Return the strokes of one station on a line of characters, the last one a full dot."""
    middle = SCALE // 2

    def cell(height: float) -> int:
        return min(max(round(middle + height / reach * middle), 0), SCALE - 1)

    line = ["."] * SCALE
    if sigma:
        for at in range(cell(-2 * sigma), cell(2 * sigma) + 1):
            line[at] = "="
    line[middle] = "|"
    for height in heights[:-1]:
        line[cell(height)] = "o"
    line[cell(heights[-1])] = "@"
    return Text("".join(line), "cyan")


def _figure(value: Any, form: str) -> str:
    return format(value, form) if isinstance(value, int | float) else UNKNOWN


def _arm(told: Mapping[str, Any]) -> Text:
    if not told.get("connected"):
        return Text("NOT CONNECTED", "bold red")
    if not told.get("referenced"):
        return Text("connected, NOT REFERENCED", "bold yellow")
    return Text("connected, referenced")


def _camera(told: Mapping[str, Any]) -> Text:
    if not told.get("connected"):
        return Text("NOT CONNECTED", "bold red")
    age = told.get("age_s")
    return Text("connected" + (f", picture {age:.0f} s old" if age is not None else ""))


def _calibration(told: Mapping[str, Any] | None) -> Text:
    if not told:
        return Text("none", "dim")
    if told.get("valid"):
        return Text("verified")
    return Text("NOT VERIFIED", "yellow")
