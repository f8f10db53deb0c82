"""The gate: closed it lets nothing pass, and what it says of motions is never too early."""

import threading

from hypothesis import given
from hypothesis import strategies as st

from legato.control.effects import StopRequested
from legato.daemon.gate import Gate, Moment
from legato.daemon.orders import DoReset, Dropped, Orders

NOW = Moment(1.0, 2.0)


def passes(orders: Orders) -> bool:
    """Say whether a motion command goes out."""
    try:
        with orders.motion():
            return True
    except (Dropped, StopRequested):
        return False


@given(actions=st.lists(st.sampled_from(["estop", "stop", "task", "reset", "late"]), max_size=12))
def test_nothing_passes_a_closed_gate(actions: list[str]) -> None:
    """Whatever came before, after an estop nothing passes until it was reset; no task opens it."""
    orders, closed = Orders(), False
    gate = orders.gate
    for action in actions:
        match action:
            case "estop":
                gate.ask("me", NOW, estop=True)
                closed = True
            case "stop":
                gate.ask("me", NOW, estop=False)
            case "task":
                orders.give(DoReset(1))
            case "reset":
                gate.reopen(gate.number)
                closed = False
            case "late":
                before = gate.number
                gate.ask("me", NOW, estop=True)
                gate.reopen(before)
                closed = True
        assert gate.closed == closed
        if closed:
            assert not passes(orders)
        assert gate.on_its_way() is None


def test_a_stop_before_the_task_is_not_the_tasks() -> None:
    """A stop asked for while a job began is its own; an earlier one is not."""
    orders = Orders()
    orders.gate.ask("me", NOW, estop=False)
    orders.give(DoReset(1))
    assert passes(orders)
    before = orders.gate.number
    orders.gate.ask("me", NOW, estop=False)
    orders.give(DoReset(2), before)
    assert not passes(orders)
    assert passes(orders)


def test_a_motion_is_on_its_way_until_the_driver_has_answered() -> None:
    """Its end is known by number, also when others have followed; a problem is kept."""
    orders = Orders()
    gate = orders.gate
    with orders.motion():
        number = gate.on_its_way()
        assert number is not None
        assert gate.end_of(number) is None
    end = gate.end_of(number)
    assert end is not None
    assert (end.number, end.problem) == (number, None)
    try:
        with orders.motion():
            failing = gate.on_its_way()
            raise OSError("no line")
    except OSError:
        pass
    assert failing is not None
    end = gate.end_of(failing)
    assert end is not None
    assert end.problem == "no line"
    for _ in range(20):
        assert passes(orders)
    assert gate.end_of(number) is not None


def test_a_confirmed_estop_is_never_followed_by_a_motion() -> None:
    """Over many races of the two threads: a motion that began is seen, one unseen never begins."""
    for _ in range(100):
        orders = Orders()
        sent, ready = list[int](), threading.Event()
        thread = threading.Thread(target=move_on, args=(orders, sent, ready))
        thread.start()
        ready.wait()
        gate = orders.gate
        gate.ask("me", NOW, estop=True)
        motion = gate.on_its_way()
        while motion is not None and gate.end_of(motion) is None:
            pass
        count = len(sent)
        thread.join(10.0)
        assert len(sent) == count


def move_on(orders: Orders, sent: list[int], ready: threading.Event) -> None:
    """Send motions until told otherwise."""
    ready.set()
    try:
        while True:
            with orders.motion():
                sent.append(1)
    except Dropped:
        return


def test_news_are_told_once() -> None:
    """The loop learns of each ask, and not twice."""
    gate = Gate()
    assert gate.news() == []
    estop, stop = gate.ask("a", NOW, estop=True), gate.ask("b", NOW, estop=False)
    assert gate.news() == [estop, stop]
    assert gate.news() == []
    assert gate.stopped_since(estop.number)
    assert not gate.stopped_since(stop.number)
