"""The one error of the configuration: it names file, key, value and what was expected."""

from pathlib import Path
from typing import Any, Final

ABSENT: Final = "nothing"
LONGEST_VALUE = 120


class ConfigError(Exception):
    """A configuration that cannot be used.

    `key` is the dotted path of the value, empty where the whole file is meant; `value` is what
    stands there, or says in words what is wrong with the file; `expected` says what should;
    `hint` says what to do.
    """

    def __init__(
        self, file: Path | str, key: str, value: Any, expected: str, hint: str = ""
    ) -> None:
        self.file = str(file)
        self.key = key
        self.value = value
        self.expected = expected
        self.hint = hint
        super().__init__(self._text())

    def _text(self) -> str:
        """Return one line: file, key, value, expectation, hint."""
        what = f"{self.key} = {shown(self.value)}" if self.key else clipped(str(self.value))
        text = f"{self.file}: {what}: expected {self.expected}"
        return f"{text} ({self.hint})" if self.hint else text


def shown(value: Any) -> str:
    """Return a value as short text; `ABSENT` itself stands for no value."""
    return value if value is ABSENT else clipped(repr(value))


def clipped(text: str) -> str:
    """Return a text, its end left out where it is long."""
    return text if len(text) <= LONGEST_VALUE else text[: LONGEST_VALUE - 3] + "..."
