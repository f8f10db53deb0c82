"""Houses and benches that let go of what they hold."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.unit.daemon.bench import ZERO, Bench, home_steps
from tests.unit.daemon.house import House, Maker


@pytest.fixture
def make(tmp_path: Path) -> Iterator[Maker]:
    """Give a maker of houses over one state folder; their records are let go at the end."""
    made: list[House] = []

    def maker(**given: Any) -> House:
        made.append(House(tmp_path, **given))
        return made[-1]

    yield maker
    for house in made:
        house.close()


@pytest.fixture
def house(make: Maker) -> House:
    """Give a house whose devices are known."""
    return make().known()


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """Give a worker on fakes whose arm stands at home, and see that its thread ends."""
    made = Bench(tmp_path, last=(home_steps(), ZERO))
    yield made
    if made.worker is not None:
        assert made.quit()
