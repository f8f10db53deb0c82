"""What systemd hears, over a real socket of its kind, and when it hears nothing."""

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from legato.daemon.notify import Notifier, Supervised
from legato.daemon.pulse import Pulse
from tests.unit.daemon.bench import Silent


@contextmanager
def listening(address: str) -> Iterator[socket.socket]:
    """Give a socket such as systemd's."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ear:
        ear.bind(address)
        ear.setblocking(False)
        yield ear


def heard(ear: socket.socket) -> list[str]:
    """Return every line that has come."""
    lines: list[str] = []
    while True:
        try:
            lines += ear.recv(4096).decode().splitlines()
        except BlockingIOError:
            return lines


class Cell:
    """A supervised daemon whose time and status are what the test says."""

    def __init__(self, folder: Path) -> None:
        self.now, self.status, self.log = 100.0, "idle", Silent()
        self.pulse = Pulse(now=lambda: self.now)
        environment = {"NOTIFY_SOCKET": str(folder / "notify"), "WATCHDOG_USEC": "30000000"}
        self.notifier = Notifier(environment)
        self.supervised = Supervised(
            self.notifier,
            self.pulse,
            self.log,
            every_s=1.0,
            status=lambda: self.status,
            now=lambda: self.now,
        )

    def beats(self, count: int, every_s: float = 1.0) -> None:
        """Let heartbeats pass."""
        for _ in range(count):
            self.now += every_s
            self.supervised.beat()


@pytest.fixture
def ear(tmp_path: Path) -> Iterator[socket.socket]:
    """Listen where the cell tells."""
    with listening(str(tmp_path / "notify")) as found:
        yield found


@pytest.fixture
def cell(tmp_path: Path, ear: socket.socket) -> Iterator[Cell]:
    """Return a supervised daemon that systemd listens to."""
    del ear
    made = Cell(tmp_path)
    yield made
    made.notifier.close()


def test_nothing_is_told_where_nobody_listens(tmp_path: Path) -> None:
    """Without the variable, with one that is none, or with a dead socket: silence, no error."""
    for path in ("", "relative/path", str(tmp_path / "nobody")):
        notifier = Notifier({"NOTIFY_SOCKET": path})
        notifier.tell("READY=1")
        notifier.close()
        notifier.tell("READY=1")


def test_an_abstract_socket_is_found() -> None:
    """Systemd writes its zero byte as @."""
    with listening(f"\0legato-test-{os.getpid()}") as ear:
        notifier = Notifier({"NOTIFY_SOCKET": f"@legato-test-{os.getpid()}"})
        notifier.tell("READY=1", "STATUS=idle")
        notifier.close()
        assert heard(ear) == ["READY=1", "STATUS=idle"]


def test_the_watchdog_is_meant_for_one_process() -> None:
    """A child that inherits the variables does not feed its parent's watchdog."""
    usec = {"WATCHDOG_USEC": "2000000"}
    assert Notifier(usec).watchdog_s == 2.0
    assert Notifier(usec | {"WATCHDOG_PID": str(os.getpid())}).watchdog_s == 2.0
    assert Notifier(usec | {"WATCHDOG_PID": "1"}).watchdog_s is None
    assert Notifier({"WATCHDOG_USEC": "soon"}).watchdog_s is None


def test_ready_comes_before_the_first_food(cell: Cell, ear: socket.socket) -> None:
    """Heartbeats before the devices are known tell the status at most."""
    cell.pulse.promise("start", 60.0)
    cell.beats(2)
    assert "WATCHDOG=1" not in heard(ear)
    cell.supervised.ready()
    cell.beats(1)
    assert heard(ear) == ["READY=1", "STATUS=idle", "WATCHDOG=1"]


def test_the_watchdog_starves_while_the_worker_is_stuck(cell: Cell, ear: socket.socket) -> None:
    """A blocked driver is logged once and shown in the status; afterwards it is fed again."""
    cell.supervised.ready()
    cell.pulse.promise("Move", 2.5)
    cell.beats(2)
    assert heard(ear).count("WATCHDOG=1") == 2
    cell.beats(3)
    assert heard(ear) == ["STATUS=stuck: Move; idle"]
    assert [event for event, _ in cell.log.lines] == ["worker_stuck"]
    cell.pulse.promise("waiting", 60.0)
    cell.beats(1)
    assert heard(ear) == ["WATCHDOG=1", "STATUS=idle"]


def test_the_watchdog_starves_while_the_loop_is_late(cell: Cell, ear: socket.socket) -> None:
    """A loop that comes too late with each heartbeat is not well; one that catches up is."""
    cell.pulse.promise("waiting", 1e6)
    cell.supervised.ready()
    cell.beats(1)
    heard(ear)
    cell.beats(3, every_s=2.5)
    assert "WATCHDOG=1" not in heard(ear)
    assert cell.supervised.late_s == pytest.approx(1.5)
    cell.beats(1)
    assert heard(ear) == ["WATCHDOG=1"]
    assert cell.supervised.late_s == 0.0


def test_the_status_is_told_when_it_changes_in_one_line(cell: Cell, ear: socket.socket) -> None:
    """The same status is not told twice, and no text can smuggle in a line of its own."""
    cell.supervised.ready()
    heard(ear)
    for status in ("capture", "capture", "fault; camera_lost: no\nREADY=1"):
        cell.status = status
        cell.supervised.changed()
    assert heard(ear) == ["STATUS=capture", "STATUS=fault; camera_lost: no READY=1"]


def test_the_end_is_told_once(cell: Cell, ear: socket.socket) -> None:
    """A signal and the loop's end both say so; only the first is heard."""
    cell.supervised.ready()
    heard(ear)
    cell.supervised.stopping()
    cell.supervised.stopping()
    cell.status = "stopping"
    cell.supervised.changed()
    assert heard(ear) == ["STOPPING=1", "STATUS=ending"]


def test_a_listener_that_reads_nothing_holds_nobody_up(cell: Cell, ear: socket.socket) -> None:
    """A full socket loses lines; nothing waits and nothing is raised."""
    cell.supervised.ready()
    cell.pulse.promise("waiting", 1e9)
    cell.beats(5000)
    assert 0 < len(heard(ear)) < 5000
