"""Where a command's words go: results to stdout, people's text to stderr where stdout is JSON.

With `--json` stdout carries exactly one JSON document, also for an error.
"""

import json
import math
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import IO, Any

import click
from rich.console import Console
from rich.table import Table
from rich.text import Text

NO_STYLES: Mapping[str, str] = {}


class Output:
    """One command's stdout and stderr."""

    def __init__(self, *, as_json: bool = False) -> None:
        self.as_json = as_json
        self.people = Console(stderr=True, highlight=False)
        self._results = Console(stderr=as_json, highlight=False)

    @property
    def terminal(self) -> bool:
        """Whether a person reads stderr on a terminal."""
        return self.people.is_terminal

    def note(self, text: str) -> None:
        """Say something on stderr."""
        self.people.print(text, markup=False, soft_wrap=True)

    def say(self, text: str) -> None:
        """Say a result to a person."""
        self._results.print(text, markup=False, soft_wrap=True)

    def table(
        self,
        columns: Sequence[str],
        rows: Iterable[Sequence[Any]],
        styles: Mapping[str, str] = NO_STYLES,
    ) -> None:
        """Show a table to a person; numbers stand to the right. A pipe gets whole lines.

        `styles` has rich's style of a cell by its text, for a terminal.
        """
        cells = [[shown(v) for v in row] for row in rows]
        right = [bool(cells) and all(numeric(r[i]) for r in cells) for i in range(len(columns))]
        if not self._results.is_terminal:
            for line in lines(columns, cells, right):
                self.say(line)
            return
        table = Table(box=None, pad_edge=False, show_header=any(columns))
        for name, numbers in zip(columns, right, strict=True):
            table.add_column(name, justify="right" if numbers else "left")
        for row in cells:
            table.add_row(*(Text(cell, styles.get(cell, "")) for cell in row))
        self._results.print(table)

    def document(self, document: Any) -> None:
        """Print the one JSON document, where `--json` was given."""
        if self.as_json:
            click.echo(json.dumps(finite(document), ensure_ascii=False))

    def line(self, document: Any) -> None:
        """Print one JSON line of a stream, where `--json` was given."""
        self.document(document)
        sys.stdout.flush()


def shown(value: Any) -> str:
    """Return a value as a table's cell."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.3f}" if isinstance(value, float) else str(value)


def numeric(cell: str) -> bool:
    """Say whether a cell holds a number, or nothing."""
    try:
        float(cell)
    except ValueError:
        return cell == "-"
    return True


def lines(
    columns: Sequence[str], cells: Sequence[Sequence[str]], right: Sequence[bool]
) -> Iterator[str]:
    """Yield a table as lines of text, the heading first where there is one."""
    head = [columns] if any(columns) else []
    widths = [max(len(r[i]) for r in [columns, *cells]) for i in range(len(columns))]
    for row in [*head, *cells]:
        parts = [
            cell.rjust(width) if numbers else cell.ljust(width)
            for cell, width, numbers in zip(row, widths, right, strict=True)
        ]
        yield "  ".join(parts).rstrip()


def finite(value: Any) -> Any:
    """Return JSON-able data with null where a number is not finite: JSON has no NaN."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(k): finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [finite(v) for v in value]
    if hasattr(value, "tolist"):  # numpy's scalars and arrays
        return finite(value.tolist())
    return value


def write_error(
    stream: IO[str], text: str, hint: str, code: int, *, as_json: bool, stdout: IO[str]
) -> None:
    """Say an error on `stream`, and as the one document on `stdout` where that is wanted."""
    click.echo(f"legato: {text}", file=stream)
    if hint:
        click.echo(f"  what to do: {hint}", file=stream)
    if as_json:
        error = {"error": {"text": text, "hint": hint, "exit": code}}
        click.echo(json.dumps(error, ensure_ascii=False), file=stdout)
