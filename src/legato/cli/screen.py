"""The live view laid out for a terminal, from what `Live` knows; nothing is asked.

The state, a fault and what to do stand first; then arm and contacts as far as there is room, and
at least a few of the last events.
"""

import time
from collections.abc import Mapping
from typing import Any

from rich import box
from rich.console import Console, RenderableType
from rich.layout import Layout
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from legato.cli.live import Live
from legato.cli.panels import (
    SCALE,
    arm,
    arm_in_short,
    boxed,
    contact_rows,
    contacts,
    states,
    steady,
)
from legato.report.devices import badge

NARROW = 112  # columns; below them panels stand under each other
SHORT = 24  # rows; below them banner and progress have no frame
STATES, CONTACTS, ARM_ROWS = 26, SCALE + 24, 7
UNHEARD = "not heard: to stop the arm, use the hardware stop"
LEAST = 4  # rows of the events, frame and all, that nothing else takes
TONES = {"fault": "red", "contact": "cyan", "session": "green", "link": "magenta", "state": "blue"}
WRAPPER = Console(width=80)  # breaks lines as any console does; prints nothing
CLOCK, TOPIC = len("00:00:00"), len("telemetry")


def screen(live: Live, now: float, width: int, height: int) -> Layout:
    """Return the whole view for a terminal of so many columns and rows."""
    fault, framed = live.status.get("fault"), height >= SHORT
    line = 3 if framed else 1
    parts = [Layout(banner(live, now, framed=framed), size=line)]
    if fault and live.state == "fault":
        told = fault_panel(fault, heard=live.link(now) == "live")
        parts.append(Layout(told, size=fault_rows(fault, width)))
    left = height - sum(part.size or 0 for part in parts) - line
    parts += middle(live, now, width, left - LEAST)
    parts += [
        Layout(progress(live, now, framed=framed), size=line),
        Layout(events(live, now, height)),
    ]
    layout = Layout()
    layout.split_column(*parts)
    return layout


def middle(live: Live, now: float, width: int, room: int) -> list[Layout]:
    """Return arm and contacts, and the states where the terminal is wide, within so many rows."""
    if width >= NARROW:
        if room < ARM_ROWS:
            return []
        row = Layout(size=min(2 + max(len(live.states), 9), room))
        row.split_row(
            Layout(aged(states(live, now), live, now), size=STATES),
            Layout(aged(arm(live), live, now), ratio=1),
            Layout(aged(contacts(live), live, now), size=CONTACTS),
        )
        return [row]
    found, left = [], room - ARM_ROWS
    if left >= 0:
        found.append(Layout(aged(arm_in_short(live), live, now), size=ARM_ROWS))
    if left >= contact_rows(live) - 1:  # the legend may be cut off
        told = aged(contacts(live), live, now)
        found.append(Layout(told, size=min(contact_rows(live), left)))
    return found


def aged(panel: Panel, live: Live, now: float) -> Panel:
    """Return a panel as it is, or dimmed and with when it was last true."""
    if live.link(now) == "live":
        return panel
    panel.style, panel.border_style = "dim", "dim"
    if live.heard_at is not None:
        panel.title = f"{panel.title}, as last heard {clock(live.heard_at, now)}"
    return panel


def clock(then: float, now: float) -> str:
    """Return the time of day of a moment of the caller's clock; shown to people only."""
    return time.strftime("%H:%M:%S", time.localtime(time.time() - now + then))


def banner(live: Live, now: float, *, framed: bool = True) -> RenderableType:
    """Return the line that tells state, link and cell at a glance."""
    link = live.link(now)
    words = Text(no_wrap=True, overflow="ellipsis")
    if live.status.get("simulated"):
        pace = _pace(live) if link == "live" else ""
        words.append(f" {badge(live.status)}{pace} ", "bold black on yellow")
        words.append(" ")
    if link == "lost":
        since = now - live.lost_at if live.lost_at is not None else 0.0
        words.append(f" CONNECTION LOST {since:.0f} s ", "bold white on red")
        words.append(f" last known: {live.state or 'nothing'}; trying again")
    elif link == "stale":
        words.append(f" STALE: nothing heard for {live.silent_s(now):.0f} s ", "bold white on red")
        words.append(f" last known: {live.state}")
    else:
        style = "bold white on red" if live.state == "fault" else "bold white on blue"
        words.append(f" {live.state} ", style)
        words.append(f" {now - live.since:.0f} s")
        words.append(_about(live))
    if not framed:
        return words
    tone = {"live": "red" if live.state == "fault" else "blue"}.get(link, "red")
    where = f"legato {live.status.get('version') or ''} at {live.endpoint}"
    ways = "`legato stop` stops" if link == "live" else "only the hardware stop stops now"
    return Panel(words, box=box.HEAVY, border_style=tone, title=where, title_align="left",
                 subtitle=f"Ctrl-C leaves; {ways}", subtitle_align="right")  # fmt: skip


def _about(live: Live) -> str:
    """Return which session it is."""
    if live.session and live.state != "idle":
        return f"   session {live.session}"
    return f"   last: {live.ended.get('job')} {live.ended.get('outcome')}" if live.ended else ""


def _pace(live: Live) -> str:
    """Return how many times as fast as the wall's the cell's clock runs, where it does."""
    return "" if live.pace is None or steady(live) else f", clock x{live.pace:.3g}"


def progress(live: Live, now: float, *, framed: bool = True) -> RenderableType:
    """Return how far the session is; of a daemon that is not heard, what stops the arm then."""
    done, total = live.progress.get("done"), live.progress.get("total")
    ended = live.ended if live.state == "idle" else None
    if live.link(now) != "live":
        words = Text(UNHEARD, "bold red", no_wrap=True, overflow="ellipsis")
        return boxed(words, "progress") if framed else words
    table = Table.grid(padding=(0, 1), expand=True)
    table.add_column(ratio=2, no_wrap=True, overflow="ellipsis")
    table.add_column(ratio=3)
    table.add_column(justify="right", no_wrap=True)
    text = str(live.progress.get("text") or "")
    if ended:
        reason = f": {ended['reason']}" if ended.get("reason") else ""
        text = f"{ended.get('job')} {ended.get('outcome')}{reason}"
    bar = ProgressBar(total=total, completed=done or 0) if total else ""
    table.add_row(Text(text), bar, f"{done}/{total}" if total else "")
    return boxed(table, "progress") if framed else table


def events(live: Live, now: float, height: int) -> RenderableType:
    """Return the last events, the newest first: time of day, topic, and text, which alone wraps."""
    table = Table.grid(padding=(0, 1), expand=True)
    table.add_column(style="dim", no_wrap=True, width=CLOCK)
    table.add_column(no_wrap=True, width=TOPIC)
    table.add_column(ratio=1, overflow="fold")
    for said in list(live.said)[::-1][: max(height, 1)]:
        when = clock(live.happened_at(said), now)
        table.add_row(when, Text(said.topic, TONES.get(said.topic, "")), Text(said.text))
    return boxed(table, "last events, newest first")


def fault_panel(fault: Mapping[str, Any], *, heard: bool = True) -> RenderableType:
    """Return the fault with what to do; `heard` says whether a daemon is there to be asked."""
    words = Text(str(fault.get("text") or ""), "bold")
    if fault.get("hint"):
        words.append(f"\nwhat to do: {fault['hint']}", "not bold")
    words.append("\nthen: legato reset" if heard else "\nthe daemon is not heard", "dim not bold")
    return Panel(words, title=f"FAULT {fault.get('cause')}", title_align="left", box=box.HEAVY,
                 border_style="bold red")  # fmt: skip


def fault_rows(fault: Mapping[str, Any], width: int) -> int:
    """Return the rows that a fault takes at a width, its frame and last line with it."""
    room = max(width - 4, 1)
    said = [str(fault.get("text") or "")]
    said += [f"what to do: {fault['hint']}"] if fault.get("hint") else []
    return 3 + sum(len(Text(words).wrap(WRAPPER, room)) for words in said)
