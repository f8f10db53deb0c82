"""Orders: each interrupt reaches the worker once, and after a drop nothing more is sent."""

import threading
from collections.abc import Callable

import pytest

from legato.control.effects import PauseRequested, StopRequested
from legato.daemon.orders import DoReset, Dropped, Orders, Quit


def test_tasks_come_in_their_order_and_none_after_the_time() -> None:
    """A worker gets what was given, or None where nothing was."""
    orders = Orders()
    orders.give(DoReset(1))
    orders.give(Quit())
    assert [orders.next_task(0.0) for _ in range(3)] == [DoReset(1), Quit(), None]


def test_a_wish_is_thrown_once() -> None:
    """The retract that follows a stop is not broken off by the same stop."""
    orders = Orders()
    orders.stop()
    with pytest.raises(StopRequested):
        orders.look()
    orders.look()


def test_a_second_pause_does_not_break_off_the_first_ones_retract() -> None:
    """Pause asked twice is one pause; after it was resumed it can be asked again."""
    orders = Orders()
    orders.pause()
    with pytest.raises(PauseRequested):
        orders.look()
    orders.pause()
    orders.look()
    orders.resume()
    orders.hold()
    orders.pause()
    with pytest.raises(PauseRequested):
        orders.look()


def test_a_stop_overrules_a_pause() -> None:
    """Of both wishes the stop is the one that is thrown."""
    orders = Orders()
    orders.pause()
    orders.stop()
    orders.pause()
    with pytest.raises(StopRequested):
        orders.look()


@pytest.mark.parametrize("wake", [Orders.stop, Orders.drop])
def test_a_held_worker_wakes_for_stop_and_drop(wake: Callable[[Orders], None]) -> None:
    """Waiting for the operator cannot keep a stop waiting."""
    orders, woke = Orders(), list[Exception]()

    def hold() -> None:
        try:
            orders.hold()
        except (StopRequested, Dropped) as error:
            woke.append(error)

    thread = threading.Thread(target=hold)
    thread.start()
    wake(orders)
    thread.join(5.0)
    assert len(woke) == 1


def test_a_dropped_job_stays_dropped_when_the_worker_is_told_to_quit() -> None:
    """Ending the daemon never lets a dropped job go on; the next task begins afresh."""
    orders = Orders()
    orders.drop()
    orders.give(Quit())
    with pytest.raises(Dropped):
        orders.look()
    with pytest.raises(Dropped):
        orders.entered()
    orders.give(DoReset(1))
    orders.look()


def test_entering_waits_for_its_answer() -> None:
    """The answer to a wanted state is taken once."""
    orders = Orders()
    orders.answer(True)
    assert orders.entered()
    orders.answer(False)
    assert not orders.entered()
