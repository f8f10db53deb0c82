"""What `status` and `describe` answer, made from what the loop knows."""

from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any

from legato import __version__
from legato.control.band import band
from legato.control.settings import CellSettings
from legato.control.states import deadline, massage_state, rows, states
from legato.control.table import ROLES, describe_table
from legato.daemon.messages import View
from legato.daemon.sessions import Session
from legato.hal.faults import Cause
from legato.wire.jsonrpc import CODES
from legato.wire.requests import API, OUTCOMES, STOP_LINE, TOPICS, describe_methods


def describe(stations: Iterable[float]) -> dict[str, Any]:
    """Return all that a client can rely on."""
    stations = tuple(stations)
    return {
        "api": API,
        "version": __version__,
        "methods": describe_methods(),
        "stop_line": describe_methods(STOP_LINE),
        "states": list(states(stations)),
        "transitions": [list(row) for row in rows(stations)],
        "deadlines_s": {s: deadline(s) for s in states(stations)},
        "table": describe_table(stations),
        "fault_causes": [str(c) for c in Cause],
        "outcomes": list(OUTCOMES),
        "errors": CODES,
        "topics": list(TOPICS),
        "roles": {role: list(methods) for role, methods in ROLES.items()},
    }


def status_told(
    settings: CellSettings,
    view: View,
    state: str,
    session: Session | None,
    fault: Mapping[str, Any] | None,
    lacking: Mapping[str, Any],
    *,
    clock: float,
) -> dict[str, Any]:
    """Return what `status` answers, but for boot and uptime; `clock` is the cell's, in s.

    `lacking` is what an idle cell refuses all the same, by admission.lacking.
    """
    return {
        "api": API,
        "version": __version__,
        "boot": None,
        "simulated": settings.simulated,
        "simulated_devices": list(settings.simulated_devices),
        "state": state,
        "session": session.id if session else None,
        "station": station_of(state, settings.stations),
        "progress": session.progress if session else None,
        "uptime_s": None,
        "arm": view.arm,
        "camera": camera_told(view, clock),
        "calibration": calibration_told(view, settings, clock),
        "fault": fault,
        "lacking": lacking,
    }


def calibration_told(view: View, settings: CellSettings, now: float) -> dict[str, Any] | None:
    """Return what status tells of the calibration; `now` is the cell's clock in s."""
    memory = view.memory
    if memory is None or memory.calibration is None:
        return None
    since = memory.verified_at if memory.verified_at is not None else view.calibrated_at
    age = now - since if since is not None else None
    fresh = age is not None and age <= settings.calibration.fresh_s
    solution = memory.calibration.solution
    window, sigmas = settings.massage.contact_window_mm, tuple(solution.sigma_stations.tolist())
    return {
        "valid": memory.verified_at is not None and fresh,
        "age_s": age,
        "rms_px": solution.rms_px,
        "sigma_mm": float(max(solution.sigma_stations)),
        "session": view.calibrated_in,
        "stations": stations_told(settings.stations, sigmas, window),
    }


@lru_cache(maxsize=4)
def stations_told(
    stations: tuple[float, ...], sigmas: tuple[float, ...], window: float
) -> list[dict[str, Any]]:
    """Return each station's band; nobody changes what is returned."""
    return [band(s, e, window).told() for s, e in zip(stations, sigmas, strict=True)]


def camera_told(view: View, now: float) -> dict[str, Any]:
    """Return what status tells of the camera; the age is that of the last picture."""
    age = now - view.picture_at if view.picture_at is not None else None
    return {"connected": view.camera_connected, "age_s": age}


@lru_cache(maxsize=64)
def station_of(state: str, stations: tuple[float, ...]) -> float | None:
    """Return the station that a massage state is at."""
    return next((s for s in stations if massage_state(s) == state), None)
