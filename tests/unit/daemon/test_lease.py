"""The lease: one client acts, others read and stop; it ends by itself, and may pause the arm."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from legato.control.effects import PauseRequested
from legato.control.table import ACTING
from legato.daemon.client import Client, RpcError
from legato.daemon.orders import Orders
from tests.unit.daemon.house import House
from tests.unit.daemon.whole import Whole, whole

BUSY, EXPIRED = -32003, -32006


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    """Give a house whose devices are known."""
    made = House(tmp_path).known()
    yield made
    made.close()


def taken(house: House, duration_s: float = 10.0, *, deadman: bool = False) -> str:
    """Take the lease and return its token."""
    return str(house.result("lease", duration_s=duration_s, deadman=deadman)["lease"])


def pausing(orders: Orders) -> bool:
    """Say whether the worker is told to pause."""
    try:
        orders.look()
    except PauseRequested:
        return True
    return False


def test_only_the_holder_acts_while_the_lease_is_held(house: House) -> None:
    """Every acting request without the token is refused as busy; reading and stopping never are."""
    token = taken(house)
    for method in ACTING:
        code, name, reason = house.error(method)
        assert (code, name) == (BUSY, "busy"), method
        assert "local has the lease" in reason
    assert house.error("home", lease="another")[0] == BUSY
    session = house.result("home", lease=token)["session"]
    assert house.result("status")["session"] == session
    assert house.result("stop")["state"] == "stopping"
    assert house.result("estop")["state"] == "fault"


def test_a_lease_ends_by_itself(house: House) -> None:
    """Unrenewed it is gone after its time, and its token with it."""
    token = taken(house, 5.0)
    assert house.result("status")["lease"] == {
        "holder": "local", "left_s": 5.0, "deadman": False,
    }  # fmt: skip
    house.pass_time(4.9)
    assert house.error("home")[0] == BUSY
    house.pass_time(0.2)
    assert house.result("status")["lease"] is None
    assert house.error("home", lease=token)[0] == EXPIRED
    assert house.error("lease", lease=token)[0] == EXPIRED
    assert house.result("home")["state"] == "move_home"


def test_a_lease_is_renewed_by_its_token_and_ended_by_it(house: House) -> None:
    """Renewed in time it goes on under one token; another cannot take it meanwhile."""
    token = taken(house, 5.0)
    for _ in range(5):
        house.pass_time(4.0)
        assert house.result("lease", lease=token, duration_s=5.0)["lease"] == token
    assert house.error("lease")[0] == BUSY
    assert house.result("lease", lease=token, duration_s=0)["lease"] is None
    assert taken(house) != token


def test_a_frozen_daemon_counts_the_frozen_time(house: House) -> None:
    """A holder that renews only after the end is late, however few turns the daemon had."""
    token = taken(house, 5.0)
    house.pass_time(20.0)
    assert house.error("lease", lease=token)[0] == EXPIRED


def test_a_deadman_pauses_a_pass_and_says_why(house: House) -> None:
    """The arm is paused once, with cause lease_lost and the name of who was lost."""
    taken(house, 2.0, deadman=True)
    token = str(house.replies[-1][1]["result"]["lease"])
    session = house.result("home", lease=token)["session"]
    assert house.task() is not None
    house.pass_time(1.9)
    assert not pausing(house.orders)
    house.pass_time(0.2)
    assert pausing(house.orders)
    assert house.want(session, "paused")
    (paused,) = [e for e in house.of("state") if e["state"] == "paused"]
    assert (paused["cause"], paused["by"]) == ("lease_lost", "local")
    house.result("resume")
    house.orders.hold()
    assert house.want(session, "move_home")
    house.pass_time(10.0)
    assert not pausing(house.orders)


def test_a_deadman_waits_for_a_state_that_can_pause(house: House) -> None:
    """Lost while the leg is looked for, the arm holds as soon as it would move."""
    token = taken(house, 2.0, deadman=True)
    session = house.result("run", lease=token)["session"]
    assert house.task() is not None
    house.pass_time(3.0)
    for state in ("calibrate", "verify"):
        assert house.want(session, state)
        assert not pausing(house.orders)
    assert house.want(session, "move_home")
    assert pausing(house.orders)


@pytest.mark.parametrize("deadman", [False, True])
def test_nothing_is_paused_that_nobody_misses(house: House, deadman: bool) -> None:
    """Without deadman, after a release, or with nothing running, a lease's end pauses nothing."""
    token = taken(house, 2.0, deadman=deadman)
    house.result("lease", lease=token, duration_s=0)
    session = house.result("home")["session"]
    assert house.task() is not None
    house.pass_time(3.0)
    assert not pausing(house.orders)
    house.end(session)
    token = taken(house, 2.0, deadman=deadman)
    house.pass_time(3.0)
    house.result("home")
    house.pass_time(1.0)
    assert not pausing(house.orders)


def test_a_command_past_its_expiry_is_refused(house: House) -> None:
    """Late it is not carried out; in time it is; a repeated key still finds its session."""
    now = house.result("ping")["now"]
    assert house.error("home", expires_at=now - 0.1)[:2] == (EXPIRED, "expired")
    assert house.result("sessions")["sessions"] == []
    session = house.result("home", key="k", expires_at=now + 5.0)["session"]
    house.pass_time(6.0)
    assert house.result("home", key="k", expires_at=now + 5.0)["session"] == session
    assert house.error("pause", expires_at=now + 5.0)[0] == EXPIRED


def test_a_job_that_expires_while_the_devices_open_is_refused(tmp_path: Path) -> None:
    """What waited too long is not begun late."""
    house = House(tmp_path)
    now = house.result("ping")["now"]
    assert house.ask("home", expires_at=now + 2.0) is None
    call = house.calls
    house.now += 3.0
    house.known()
    answer = house.answer(call)
    assert answer is not None
    assert answer["error"]["code"] == EXPIRED


@pytest.fixture
def cell(tmp_path: Path) -> Iterator[Whole]:
    """Give a daemon on fakes."""
    with whole(tmp_path) as made:
        yield made


def test_the_client_holds_a_lease_while_it_listens(cell: Whole) -> None:
    """Calls and listening renew it; a client that does neither loses it, and the arm pauses."""
    ends = cell.sockets.endpoints
    with Client(ends["requests"], ends["events"]) as client:
        told = client.lease(0.6, deadman=True)
        assert (told["holder"], told["deadman"]) == ("local", True)
        assert cell.error("home")["code"] == BUSY
        session = client.call("home")["session"]
        until = time.monotonic() + 1.5
        for _ in client.events(0.3):
            if time.monotonic() > until:
                break
        assert client.call("status")["state"] == "move_home"
        cell.until(lambda: cell.conductor.state == "paused")
        with pytest.raises(RpcError, match="lease has ended") as caught:
            client.call("resume")
        assert caught.value.code == EXPIRED
        assert client.call("status")["lease"] is None
        client.call("stop")
        assert client.call("wait", session=session)["outcome"] == "stopped"


def test_the_client_gives_its_commands_a_time(cell: Whole) -> None:
    """A command is measured by the daemon's clock; one that came too late is refused."""
    with Client(cell.sockets.endpoints["requests"]) as client:
        with pytest.raises(RpcError) as caught:
            client.call_within(-1.0, "home")
        assert caught.value.code == EXPIRED
        assert client.call_within(30.0, "home")["state"] == "move_home"
        client.lease()
        client.release()
        assert client.call("stop")["state"] == "stopping"
