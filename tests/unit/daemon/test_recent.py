"""An answer that is kept for a moment is never older than what else was told."""

from legato.daemon.recent import KEPT_S, Recent


def counting() -> Recent:
    """Return what tells how often it was made."""
    made: list[float] = []

    def make(now: float) -> dict[str, object]:
        made.append(now)
        return {"times": len(made), "now": now}

    return Recent(make)


def test_it_is_made_once_within_its_time() -> None:
    """The same bytes come again until their time is over, then new ones."""
    recent = counting()
    first = recent.told(10.0, 1)
    assert bytes(first) == b'{"times":1,"now":10.0}'
    assert recent.told(10.0 + 0.9 * KEPT_S, 1) is first
    assert bytes(recent.told(10.0 + KEPT_S, 1)).startswith(b'{"times":2')


def test_another_version_is_made_at_once() -> None:
    """What has changed is told at once, and a version that comes back is no earlier answer."""
    recent = counting()
    told = [bytes(recent.told(10.0, version))[:11] for version in (1, 2, 2, 1)]
    assert told == [b'{"times":1,', b'{"times":2,', b'{"times":2,', b'{"times":3,']


def test_a_clock_that_steps_back_keeps_nothing() -> None:
    """A time before the answer's own makes it anew."""
    recent = counting()
    recent.told(10.0, 1)
    assert bytes(recent.told(9.0, 1)) == b'{"times":2,"now":9.0}'
