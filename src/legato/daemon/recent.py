"""One answer kept encoded for a few milliseconds, as long as nothing that it tells has changed.

Ten pages and a script that ask at once cost one answer.
"""

from collections.abc import Callable, Hashable, Mapping
from math import inf
from typing import Any, Final

import msgspec

from legato.wire.jsonrpc import encode

KEPT_S: Final = 0.005


class Recent:
    """Keeps what `make` has told; `version` differs once anything may have changed but ages."""

    def __init__(self, make: Callable[[float], Mapping[str, Any]]) -> None:
        self._make = make
        self._told = msgspec.Raw()
        self._version: Hashable = None
        self._until = -inf

    def told(self, now: float, version: Hashable) -> msgspec.Raw:
        """Return the answer as JSON, made anew where it is of another version or too old."""
        if version != self._version or not self._until - KEPT_S <= now < self._until:
            self._told = msgspec.Raw(encode(self._make(now)))
            self._version, self._until = version, now + KEPT_S
        return self._told
