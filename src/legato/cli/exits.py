"""The exit codes, the same for every command, and the error that ends one with its code."""

from enum import IntEnum


class Exit(IntEnum):
    """What a shell script can tell from a command's end."""

    DONE = 0
    FAILED = 1
    USAGE = 2
    REFUSED = 3
    FAULT = 4
    NO_DAEMON = 5


EXITS = frozenset(int(code) for code in Exit) - {int(Exit.DONE)}

EPILOG = "Exit codes: 0 done, 1 failed, 2 usage or configuration, 3 refused, 4 fault, 5 no daemon."

OUTCOMES = {
    "done": Exit.DONE,
    "stopped": Exit.FAILED,
    "refused": Exit.REFUSED,
    "fault": Exit.FAULT,
    "interrupted": Exit.FAULT,
}

REFUSALS = {
    -32000: Exit.REFUSED,  # refused_in_state
    -32001: Exit.REFUSED,  # precondition
    -32002: Exit.REFUSED,  # not_authorised
    -32003: Exit.REFUSED,  # busy
    -32004: Exit.FAULT,  # in_fault
    -32005: Exit.FAILED,  # unavailable
    -32006: Exit.REFUSED,  # expired
    -32602: Exit.USAGE,  # JSON-RPC: invalid parameters
}


class Failure(Exception):
    """The end of a command for a reason that a person can act on."""

    def __init__(self, text: str, exit_code: Exit = Exit.FAILED, hint: str = "") -> None:
        super().__init__(text)
        self.text = text
        self.code = exit_code
        self.hint = hint


def exit_of(outcome: str | None) -> Exit:
    """Return the code of a session's outcome; one that is not known yet has failed."""
    return OUTCOMES.get(outcome or "", Exit.FAILED)
