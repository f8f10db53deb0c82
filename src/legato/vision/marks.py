"""What picking gives: where each mark lies in the picture and which are missing."""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class FoundMark:
    """One mark's centre in px and the standard deviation of each coordinate.

    `size` is its side over what the leg model and its place say, with a standard deviation.
    """

    u: float
    v: float
    sigma: float
    size: float = 1.0
    size_sigma: float = float("inf")


@dataclass(frozen=True)
class Picking:
    """Marks by name, the names of those not found with the reason, and what was tried."""

    marks: Mapping[str, FoundMark]
    missing: Mapping[str, str] = field(default_factory=dict)
    candidates: int = 0
    method: str = "automatic"


class MarksNotFound(Exception):
    """A picture in which the marks cannot be found or told apart; says why and what to do."""

    def __init__(self, text: str, hint: str, candidates: int = 0) -> None:
        self.text = text
        self.hint = hint
        self.candidates = candidates
        super().__init__(f"{text} ({hint})")
