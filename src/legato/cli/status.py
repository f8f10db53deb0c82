"""`legato status`: what the cell does now."""

from collections.abc import Mapping
from typing import Any

from legato.cli.command import Context, command
from legato.cli.exits import Exit
from legato.cli.line import connected
from legato.report.devices import cell


@command("status")
def status(context: Context) -> None:
    """Show the cell's state, its devices, calibration and fault; exit 4 in fault."""
    with connected(context) as client:
        answer = client.call("status")
    context.output.document(answer)
    context.output.table(("", ""), rows(answer))
    if answer.get("state") == "fault":
        context.end(Exit.FAULT)


def rows(answer: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return a status as names and values for a person."""
    arm, camera = answer.get("arm") or {}, answer.get("camera") or {}
    clock = " by the cell's clock" if answer.get("simulated") else ""
    found = [
        (
            "state",
            str(answer.get("state")) + (f" ({cell(answer)})" if answer.get("simulated") else ""),
        ),
        ("session", _session(answer)),
        ("arm", _arm(arm)),
        ("camera", _camera(camera, clock)),
        ("calibration", _calibration(answer.get("calibration"), clock)),
        ("up", f"{answer.get('uptime_s') or 0:.0f} s, legato {answer.get('version')}"),
    ]
    if answer.get("station") is not None:
        found.insert(2, ("station", f"{answer['station']:g} mm"))
    if campaign := answer.get("campaign"):
        found.append(("campaign", _campaign(campaign)))
    if fault := answer.get("fault"):
        found.append(("fault", f"{fault.get('cause')}: {fault.get('text')}"))
        found.append(("what to do", str(fault.get("hint"))))
    return found


def _session(answer: Mapping[str, Any]) -> str:
    """Return the session that runs, or the one that the fault has ended."""
    ended = (answer.get("fault") or {}).get("session")
    return str(answer.get("session") or (f"{ended}, ended by the fault" if ended else "-"))


def _campaign(campaign: Mapping[str, Any]) -> str:
    of = f" of {campaign['total']}" if campaign.get("total") else ""
    done = f"{campaign.get('done')}{of} done, {campaign.get('failed')} failed"
    if not campaign.get("underway"):
        return f"{campaign.get('id')} {campaign.get('outcome')}: {done}"
    left = campaign.get("next_in_s")
    soon = f", next in {left:.0f} s" if left is not None else ""
    return f"{campaign.get('id')} by {campaign.get('by')}: {done}{soon}"


def _arm(arm: Mapping[str, Any]) -> str:
    if not arm.get("connected"):
        return "not connected"
    if not arm.get("referenced"):
        return "connected, not referenced"
    place = ", ".join(f"{v:.1f}" for v in arm.get("xyz_mm") or ())
    return f"at ({place}) mm, contact {'yes' if arm.get('contact') else 'no'}"


def _camera(camera: Mapping[str, Any], clock: str) -> str:
    if not camera.get("connected"):
        return "not connected"
    age = camera.get("age_s")
    return "connected" + (f", last picture {age:.1f} s ago{clock}" if age is not None else "")


def _calibration(calibration: Mapping[str, Any] | None, clock: str) -> str:
    if not calibration:
        return "none"
    valid = "verified" if calibration.get("valid") else "not verified"
    return f"{valid}, {calibration.get('age_s') or 0:.0f} s old{clock}"
