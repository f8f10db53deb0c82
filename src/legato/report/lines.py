"""One event as one line for a person: of the daemon as it comes, or of a record."""

from collections.abc import Mapping
from typing import Any


def line_of(topic: str, event: Mapping[str, Any]) -> str:
    """Return what an event says, without its time."""
    match topic:
        case "state":
            cause = f" ({event['cause']})" if event.get("cause") else ""
            return f"{event.get('state')}{cause}"
        case "progress":
            count = f" ({event['done']}/{event['total']})" if event.get("total") else ""
            return f"{event.get('text')}{count}"
        case "contact":
            return (
                f"touched at {_figure(event, 'station_mm', 'g')} mm, "
                f"{_figure(event, 'contact_mm', '+.2f')} mm from the prediction"
            )
        case "fault":
            hint = f"; {event['hint']}" if event.get("hint") else ""
            return f"{event.get('cause')}: {event.get('text')}{hint}"
        case "session":
            outcome = event.get("outcome") or "begun"
            reason = f": {event['reason']}" if event.get("reason") else ""
            return f"{event.get('job')} {event.get('id')} {outcome}{reason}"
        case "campaign":
            return _campaign(event)
        case "telemetry":
            return _telemetry(event)
        case "heartbeat":
            return f"{event.get('state')}, up {_figure(event, 'uptime_s', '.0f')} s"
        case _:
            told = ((k, v) for k, v in event.items() if k not in HEAD and v is not None)
            return "; ".join(f"{k}: {v}" for k, v in told)


HEAD = ("boot", "seq", "t", "session")


def _campaign(event: Mapping[str, Any]) -> str:
    """Return what a campaign has come to."""
    of = f" of {event['total']}" if event.get("total") else ""
    parts = [f"{event.get('what')} {event.get('id')}: {event.get('done')}{of} done"]
    if event.get("failed"):
        parts.append(f"{event['failed']} failed")
    if event.get("next_in_s"):
        parts.append(f"next in {_figure(event, 'next_in_s', '.0f')} s")
    if event.get("outcome"):
        parts.append(str(event["outcome"]))
    if event.get("reason"):
        parts.append(str(event["reason"]))
    return ", ".join(parts)


def _telemetry(event: Mapping[str, Any]) -> str:
    """Return where the arm is, what for, and whether it touches."""
    arm = event.get("arm") or {}
    place = arm.get("xyz_mm")
    parts = ["at " + ", ".join(f"{v:.1f}" for v in place) + " mm" if place else "place not known"]
    if event.get("why"):
        parts.append(str(event["why"]))
    if event.get("station_mm") is not None:
        parts.append(f"station {_figure(event, 'station_mm', 'g')} mm")
    if arm.get("contact"):
        parts.append("contact")
    return ", ".join(parts)


def _figure(event: Mapping[str, Any], key: str, form: str) -> str:
    """Return a number of an event, or `?` where it has none."""
    value = event.get(key)
    return format(value, form) if isinstance(value, int | float) else "?"
