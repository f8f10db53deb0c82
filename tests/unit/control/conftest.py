"""The bench as a fixture."""

from collections.abc import Callable

import pytest

from tests.unit.control.cell import Bench, make_bench


@pytest.fixture
def bench() -> Callable[..., Bench]:
    """Return a maker of benches: by seed, or with changed settings."""
    return make_bench
