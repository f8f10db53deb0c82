"""Who asks: a name for the records, and a role that says what it may ask for."""

from dataclasses import dataclass
from typing import Final

from legato.control.table import OPERATOR


@dataclass(frozen=True)
class Who:
    """One client as the daemon knows it."""

    name: str
    role: str


# Without encryption only this machine's own users reach the daemon, and all of them may act.
LOCAL: Final = Who("local", OPERATOR)
NOBODY: Final = Who("nobody", "none")
