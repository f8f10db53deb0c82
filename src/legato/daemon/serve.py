"""The daemon's main: lock, records, sockets, worker, loop, and the way out of all of them."""

import secrets
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import zmq
from msgspec import to_builtins

from legato import __version__
from legato.config.build import cell_settings
from legato.daemon.cell import build_cell, build_clock
from legato.daemon.conductor import Conductor
from legato.daemon.doorman import Doorman
from legato.daemon.events import Events
from legato.daemon.journal import Journal
from legato.daemon.keys import read_clients, read_secret
from legato.daemon.lock import AlreadyRunning, only_instance
from legato.daemon.log import Log, make_log
from legato.daemon.loop import Loop
from legato.daemon.mailbox import Mailbox
from legato.daemon.orders import Orders
from legato.daemon.past import Past, arm_name, read_older, read_past
from legato.daemon.sessions import Sessions
from legato.daemon.sockets import Sockets
from legato.daemon.standing import Setting, Standing
from legato.daemon.stopline import StopLine
from legato.daemon.tidy import Tidy
from legato.daemon.watching import Watching
from legato.daemon.worker import Worker
from legato.records.errors import RecordError
from legato.records.store import Store

if TYPE_CHECKING:
    from legato.config.load import Loaded
    from legato.config.schema import RecordsTable, ServerTable
    from legato.daemon.worker import Procedures

SWITCH_S = 0.0005  # Python's own thread switch: the loop answers while the worker computes
JOIN_S = 5.0
ENDING = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT)
IGNORED = (signal.SIGUSR1, signal.SIGUSR2)


def serve(loaded: "Loaded", log: Log | None = None, procedures: "Procedures | None" = None) -> int:
    """Run the daemon until shutdown or a signal; return the process's exit code.

    `procedures` are what its jobs do, by default what control.jobs says.
    """
    log = log if log is not None else make_log()
    sys.setswitchinterval(SWITCH_S)
    state_dir = Path(loaded.config.records.state_dir)
    try:
        with only_instance(state_dir):
            return _serve(loaded, Store(state_dir), log, procedures)
    except AlreadyRunning as error:
        log.error("already_running", text=str(error), hint="stop it first")
    except RecordError as error:
        log.error("records", text=error.text, hint=error.hint)
    except zmq.ZMQError as error:
        server = loaded.config.server
        hint = "see what listens there, or set [server] to other ports"
        log.error("not_bound", requests=server.requests, events=server.events, stop=server.stop,
                  text=str(error), hint=hint)  # fmt: skip
    except OSError as error:
        log.error("state_dir", text=str(error), hint="make records.state_dir writable")
    return 1


def _serve(loaded: "Loaded", store: Store, log: Log, procedures: "Procedures | None" = None) -> int:
    """Run the daemon whose state folder is locked."""
    config = loaded.config
    settings = cell_settings(loaded)
    boot = secrets.token_hex(8)
    mailbox, orders = Mailbox(), Orders()
    doorman = _doorman(config.server, mailbox)
    past = read_past(store, log, arm=arm_name(config.robot))
    server = config.server
    watching = Watching(config, store, log)
    sockets = Sockets(server.requests, server.events, server.stop, doorman)
    stopline = StopLine(
        sockets.stop,
        sockets.receive,
        orders.gate,
        (orders.wake, mailbox.ring),
        boot=boot,
        state=lambda: conductor.state,
        post=mailbox.offer,
    )
    try:
        clock = build_clock(loaded)
        events = Events(boot, clock.monotonic, sockets.publish)
        setting = Setting(
            settings=settings,
            boot=boot,
            clock=clock.monotonic,
            min_free_mb=config.records.min_free_mb,
            meta=_meta(loaded),
        )
        conductor = _conductor(setting, orders, store, past, events, log, watching)
        stopline.start()
        desk = watching.desk(conductor, events, settings, sockets.send, log, stopline.told)
        watching.begin(conductor, desk, stopline)
        worker = Worker(
            lambda: build_cell(loaded, clock),
            settings,
            orders,
            mailbox.put,
            log,
            last=past.last,
            procedures=procedures,
            tidy=_tidy(config.records, store, log),
            recall=partial(read_older, store, log),
            pulse=watching.pulse,
            timed=watching.counts.timed,
        )
        ends = sockets.endpoints
        ready = partial(_ready, watching, partial(log.info, "ready", boot=boot, **ends))
        listening = partial(log.info, "listening", version=__version__, boot=boot, **ends)
        loop = Loop(sockets, mailbox, conductor, desk, events, ready, listening)
        with _signals(mailbox, watching.stopping) as ending:
            worker.start()
            try:
                loop.run(lambda: ending[0] if ending else None)
            except BaseException:
                orders.drop()  # a bug in the loop must not leave the arm moving on
                raise
        watching.stopping()
        desk.close()
        log.info("ended", clean=worker.join(JOIN_S))
        return conductor.exit_code
    finally:
        stopline.end()
        sockets.close()
        mailbox.close()
        watching.close()


def _ready(watching: Watching, log_it: Callable[[], None]) -> None:
    """Tell log and systemd that both devices are known, or known to be missing."""
    log_it()
    watching.ready()


def _tidy(records: "RecordsTable", store: Store, log: Log) -> Tidy:
    """Return what removes old records."""
    return Tidy(
        store,
        log,
        keep_days=records.keep_days,
        keep_newest=records.keep_sessions,
        min_free_mb=records.min_free_mb,
    )


def _meta(loaded: "Loaded") -> dict[str, Any]:
    """Return what every record says of the configuration; it is enough to replay it."""
    lens = to_builtins(loaded.intrinsics) if loaded.intrinsics is not None else None
    return {"config_hash": loaded.hash, "config": loaded.data, "intrinsics": lens}


def _doorman(server: "ServerTable", mailbox: Mailbox) -> Doorman | None:
    """Return who guards the sockets, None where nothing is encrypted. Raises ConfigError."""
    if server.curve is None:
        return None
    keys = read_secret(Path(server.curve.secret), "server.curve.secret")
    return Doorman(keys, read_clients(Path(server.curve.clients)), mailbox.offer)


def _conductor(
    setting: Setting,
    orders: Orders,
    store: Store,
    past: Past,
    events: Events,
    log: Log,
    watching: Watching,
) -> Conductor:
    """Return the conductor in idle, or in the fault that the past has left."""
    sessions = Sessions(store, past.sessions)
    journal = Journal(
        sessions, events, store, setting.clock, log, past.last, past.arm, watching.heard
    )
    now = time.monotonic()
    standing = Standing(setting, sessions, journal, log, now=now, fault=past.fault)
    return Conductor(setting, standing, journal, orders, store, log)


@contextmanager
def _signals(mailbox: Mailbox, told: Callable[[], None]) -> Iterator[list[str]]:
    """Collect the names of ENDING in a list, each waking the loop after `told` was called.

    What else ends a process by default ends nothing: the arm might be on the leg.
    """
    came: list[str] = []

    def collect(number: int, frame: Any) -> None:  # noqa: ARG001  # the signature is signal's
        came.append(signal.Signals(number).name)
        told()

    before = {n: signal.signal(n, collect) for n in ENDING}
    before |= {n: signal.signal(n, signal.SIG_IGN) for n in IGNORED}
    if before[signal.SIGHUP] == signal.SIG_IGN:  # nohup
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    wake = signal.set_wakeup_fd(mailbox.wake_fileno(), warn_on_full_buffer=False)
    try:
        yield came
    finally:
        signal.set_wakeup_fd(wake)
        for number, handler in before.items():
            signal.signal(number, handler)
