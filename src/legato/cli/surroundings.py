"""What `legato check` sees around the configuration: the daemon, its keys, the clock, a picture.

The camera is opened only while no daemon has it; the arm's line never, since opening one may
reset what hangs on it.
"""

import ctypes
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from legato.cli.command import Context
from legato.cli.doctor import Finding, camera

if TYPE_CHECKING:
    from legato.config.load import Loaded
    from legato.hal.camera import Camera

NOT_SYNCHRONISED = 5  # TIME_ERROR of adjtimex
TIMEX_BYTES = 1024  # more than the structure has on any platform


def around(context: Context, loaded: "Loaded", now: datetime) -> Iterator[Finding]:
    """Yield what is found of daemon, keys, clock and camera."""
    yield from keys(loaded)
    status = asked(context)
    yield daemon(status)
    yield clock(loaded, now, synchronised())
    free = not isinstance(status, dict) and loaded.config.camera.driver != "sim"
    if free and camera(loaded).ok is not False:
        yield picture(loaded)


def asked(context: Context) -> dict[str, Any] | Exception:
    """Return the daemon's status, or why there is none."""
    from legato.cli.exits import Failure
    from legato.cli.line import connected
    from legato.config.errors import ConfigError
    from legato.daemon.client import DaemonUnavailable, RpcError

    try:
        with connected(context) as client:
            return dict(client.call("status"))
    except (ConfigError, DaemonUnavailable, Failure, RpcError) as error:
        return error


def daemon(status: dict[str, Any] | Exception) -> Finding:
    """Return whether a daemon runs, of which version, and what it is in."""
    from legato import __version__
    from legato.config.errors import ConfigError
    from legato.daemon.client import DaemonUnavailable

    if isinstance(status, DaemonUnavailable):
        hint = "start it with `legato serve`, or as a service with systemd/"
        return Finding("daemon", None, "none runs here", hint)
    if isinstance(status, ConfigError):
        return Finding("daemon", None, f"it cannot be asked from here: {status}", status.hint)
    if isinstance(status, Exception):
        text = f"it cannot be asked: {status}"
        return Finding("daemon", False, text, str(getattr(status, "hint", "")))
    said = f"runs, state {status.get('state')}, up {status.get('uptime_s') or 0:.0f} s"
    if status.get("version") != __version__:
        text = f"{said}, but is legato {status.get('version')} and this is {__version__}"
        return Finding("daemon", None, text, "restart it when nothing is running")
    if fault := status.get("fault"):
        hint = f"{fault.get('hint')}; then `legato reset`"
        return Finding("daemon", False, f"{said}: {fault.get('text')}", hint)
    arm = status.get("arm") or {}
    for what, told in (("arm", arm), ("camera", status.get("camera") or {})):
        if not told.get("connected"):
            hint = f"see that the {what} is on and plugged in, then `legato reset`"
            return Finding("daemon", None, f"{said}, the {what} is not connected", hint)
    if not arm.get("referenced"):
        hint = "bring the arm to its start pose, then `legato reference`"
        return Finding("daemon", None, f"{said}, the arm is not referenced", hint)
    return Finding("daemon", True, said)


def keys(loaded: "Loaded") -> Iterator[Finding]:
    """Yield whether the files of the encryption are there and closed to others."""
    from legato.config.errors import ConfigError
    from legato.daemon.keys import client_keys, read_clients, read_secret

    server = loaded.config.server
    try:
        if server.curve is not None:
            read_secret(Path(server.curve.secret), "server.curve.secret")
            clients = read_clients(Path(server.curve.clients))
            names = ", ".join(sorted(who.name for who in clients.values()))
            text = f"the daemon's secret is its own; may come in: {names or 'nobody'}"
            hint = "" if clients else "make a client's key with `legato keygen`"
            yield Finding("keys", True if clients else None, text, hint)
        if server.is_client:
            client_keys(server, loaded.path)
            yield Finding("client key", True, f"{server.client_secret}")
    except ConfigError as error:
        yield Finding("keys", False, str(error), error.hint)


def clock(loaded: "Loaded", now: datetime, synced: bool | None) -> Finding:
    """Return whether the host's clock can be believed: synchronised, and not behind the records.

    `synced` is None where the kernel does not tell. Only records and ages need wall time.
    """
    from legato.records.errors import RecordError
    from legato.records.ids import moment
    from legato.records.store import Store

    try:
        latest = next(iter(Store(Path(loaded.config.records.state_dir)).sessions()), None)
        began = moment(latest.started) if latest is not None else None
    except (RecordError, ValueError):
        began = None
    said = now.astimezone().isoformat(timespec="seconds")
    hint = "set the clock and have it synchronised: `timedatectl set-ntp true`"
    if began is not None and now < began:
        text = f"{said} is before the last session began ({began.isoformat(timespec='seconds')})"
        return Finding("clock", False, text, hint)
    if synced is False:
        return Finding("clock", None, f"{said}, not synchronised", hint)
    return Finding("clock", True, said + (", synchronised" if synced else ""))


def synchronised() -> bool | None:
    """Say whether the kernel takes its clock for synchronised, None where it does not tell."""
    try:
        call = ctypes.CDLL(None, use_errno=True).adjtimex
    except (AttributeError, OSError):
        return None
    state = int(call(ctypes.create_string_buffer(TIMEX_BYTES)))  # zeros: read and change nothing
    return None if state < 0 else state != NOT_SYNCHRONISED


def picture(loaded: "Loaded") -> Finding:
    """Return whether the camera gives a picture now."""
    from legato.daemon.cell import build_cell

    return grabbed(build_cell(loaded).camera, str(loaded.config.camera.source))


def grabbed(device: "Camera", source: str) -> Finding:
    """Return whether a camera gives a picture now; it is closed again."""
    from legato.hal.faults import DeviceError

    try:
        device.open()
        height, width = device.grab().image.shape[:2]
    except DeviceError as error:
        return Finding("picture", False, error.text, error.hint)
    finally:
        device.close()
    return Finding("picture", True, f"{width} x {height} px from {source}")
