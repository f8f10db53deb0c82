"""One event of the daemon as one line for a person."""

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
            return f"fault {event.get('cause')}: {event.get('text')}{hint}"
        case "session":
            outcome = event.get("outcome") or "begun"
            reason = f": {event['reason']}" if event.get("reason") else ""
            return f"{event.get('job')} {event.get('id')} {outcome}{reason}"
        case "telemetry":
            place = event.get("xyz_mm") or []
            return "at " + ", ".join(f"{v:.1f}" for v in place) + " mm"
        case _:
            return ", ".join(f"{k} {v}" for k, v in event.items() if k not in HEAD)


HEAD = ("boot", "seq", "t", "session")


def _figure(event: Mapping[str, Any], key: str, form: str) -> str:
    """Return a number of an event, or `?` where it has none."""
    value = event.get(key)
    return format(value, form) if isinstance(value, int | float) else "?"
