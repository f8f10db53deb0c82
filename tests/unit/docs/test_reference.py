"""The reference's pages: nothing that the code has is missing from them."""

import msgspec
import pytest

from docs.gen import commands, configuration, events, faults, records, wire
from docs.gen.tables import table
from legato.cli.main import main
from legato.config.schema import Config
from legato.control.states import states
from legato.control.table import METHODS
from legato.hal.faults import Cause
from legato.wire.requests import REQUESTS, STOP_LINE, TOPICS

STATIONS = (7.0, 67.0, 127.0, 187.0)


def rows(page: str, first: str) -> list[str]:
    """Return a page's table rows that begin with a cell."""
    return [line for line in page.splitlines() if line.startswith(f"| {first} |")]


def test_every_key_of_the_configuration_has_a_row_with_its_meaning() -> None:
    """Type, default and meaning are there for each; none is left without a word."""
    page = configuration.page()
    for name, struct in configuration.tables(Config):
        section = page.split(f"## `[{name}]`\n")[1].split("\n## ")[0]
        for field in msgspec.structs.fields(struct):
            if f"{name}.{field.encode_name}" in dict(configuration.tables(Config)):
                continue
            (row,) = rows(section, f"`{field.encode_name}`")
            if (name, field.encode_name) != ("leg", "marks"):
                assert not row.endswith("|  |"), f"[{name}] {field.encode_name} has no meaning"


def test_limits_and_defaults_are_the_schemas() -> None:
    """They are read from the types, as the file would have them."""
    page = configuration.page()
    (row,) = rows(page, "`press_mm`")
    assert "number (≥ 0, ≤ 5)" in row
    assert "`1.5`" in row
    (row,) = rows(page, "`engine`")
    assert '`"hybrid"`, `"paper"`, `"separable"`' in row


def test_every_method_state_topic_and_error_is_on_the_wires_page() -> None:
    """What can be asked, and what is answered in which state."""
    page = wire.reference(STATIONS)
    for method in METHODS:
        assert rows(page, f"`{method}`"), method
        assert f"### {method}\n" in page
    for method in STOP_LINE:
        assert len(rows(page.split("## The stop line")[1], f"`{method}`")) >= 1
    for topic in TOPICS:
        assert f"### `{topic}`" in page
    for state in states(STATIONS):
        assert rows(page, f"`{state}`"), state
    assert set(REQUESTS) == set(METHODS)


def test_every_parameter_of_every_method_is_told() -> None:
    """With its type and default."""
    page = wire.reference(STATIONS)
    for name, request in REQUESTS.items():
        section = page.split(f"### {name}\n")[1].split("\n### ")[0].split("\n## ")[0]
        for field in msgspec.structs.fields(request):
            assert rows(section, f"`{field.encode_name}`"), f"{name}.{field.encode_name}"


def test_topics_and_their_words_belong_together() -> None:
    """A new topic needs its words, a topic that is gone loses them."""
    assert set(events.FIELDS) == set(TOPICS)


def test_every_cause_has_a_meaning_and_those_that_code_raises_have_hints() -> None:
    """The page is read from the code that raises them."""
    page = faults.page()
    for cause in Cause:
        (row,) = [line for line in page.splitlines() if line.startswith(f"| [`{cause}`]")]
        assert not row.endswith("|  |"), cause
    found = {raised.cause for raised in faults.raised() if raised.hint}
    assert {"ARM_LOST", "CONTACT_EARLY", "CONTACT_LATE", "MARKS_NOT_FOUND", "LIMIT"} <= found


def test_every_command_and_option_is_told() -> None:
    """Groups and what is in them, in the words of `--help`."""
    page = commands.page()
    for path, command in commands.every(main):
        section = page.split(f"### {' '.join(path)}\n")[1].split("\n### ")[0]
        for parameter in command.params:
            if not set(parameter.opts) & set(commands.COMMON) and parameter.opts[0].startswith("-"):
                assert parameter.opts[-1] in section, (path, parameter.opts)


def test_records_columns_are_those_that_are_written() -> None:
    """A column that nobody explains is an error when the page is made."""
    page = records.page()
    for place in records.FILES:
        assert rows(page, f"`{place}`")


def test_a_pipe_in_a_cell_does_not_end_it() -> None:
    """Choices like `a|b` stand in one cell."""
    assert table(("x",), [("`a|b`",)]).splitlines()[2] == "| `a\\|b` |"


@pytest.mark.parametrize("value", ["", "nothing"])
def test_a_comment_behind_a_value_is_found(value: str) -> None:
    """A `#` inside quotes is none."""
    said = configuration.explained(f'[t] # table\nkey = "a#b" # {value}\n      # more\n')
    assert said.keys["t.key"] == f"{value} more".strip()
    assert said.tables["t"] == ["table"]
