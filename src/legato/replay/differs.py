"""The first place where a record and its replay part, and how values are held together."""

import math
from collections.abc import Mapping, Sequence
from itertools import zip_longest
from typing import Any

import msgspec

from legato.records.files import encode

CLOSE = 1e-6  # of a figure's size, or absolute below 1: what is worked out anew may be off by this


class Differs(Exception):
    """The record says one thing, the replay another: where, and both."""

    def __init__(self, where: str, recorded: object, replayed: object) -> None:
        self.where = where
        self.recorded = plain(recorded)
        self.replayed = plain(replayed)
        super().__init__(f"{where}: recorded {self.recorded!r}, replayed {self.replayed!r}")


def plain(value: object) -> Any:
    """Return a value as it comes back from JSON."""
    return msgspec.json.decode(encode(value))


def hold(where: str, recorded: object, replayed: object) -> None:
    """Raise Differs where two values, once through JSON, are not the same; names the member."""
    _hold(where, plain(recorded), plain(replayed))


def _hold(where: str, recorded: Any, replayed: Any) -> None:
    if isinstance(recorded, Mapping) and isinstance(replayed, Mapping):
        for name in sorted(recorded.keys() | replayed.keys()):
            _hold(f"{where}, {name}", recorded.get(name), replayed.get(name))
    elif isinstance(recorded, Sequence) and not isinstance(recorded, str):
        if not isinstance(replayed, Sequence) or isinstance(replayed, str):
            raise Differs(where, recorded, replayed)
        for number, pair in enumerate(zip_longest(recorded, replayed), start=1):
            _hold(f"{where}, {number}", *pair)
    elif not _same(recorded, replayed):
        raise Differs(where, recorded, replayed)


def _same(recorded: Any, replayed: Any) -> bool:
    numbers = all(type(v) in (int, float) for v in (recorded, replayed))
    if numbers and float in (type(recorded), type(replayed)):
        return math.isclose(recorded, replayed, rel_tol=CLOSE, abs_tol=CLOSE)
    return bool(recorded == replayed)
