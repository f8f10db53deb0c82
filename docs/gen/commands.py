"""Every command and option, from click itself."""

import re
from collections.abc import Iterator

import click

from docs.gen.tables import plain, table
from legato.cli.examples import EXAMPLES
from legato.cli.exits import EPILOG
from legato.cli.main import main

HEAD = """\
# Command line

Every command takes `--config FILE` and `--json`; `--help` says the same as this page, which is
made from the commands themselves. Without `--config` it is the shipped simulated cell.

With `--json` one JSON document comes on stdout and people's text on stderr. On a terminal long jobs
show their progress, in a pipe plain lines. Ctrl-C asks a running job to stop.

## Exit codes

| code | means |
|---|---|
| 0 | done |
| 1 | failed |
| 2 | usage or configuration |
| 3 | refused |
| 4 | fault |
| 5 | no daemon |

`status` also ends with 4 while the cell is in fault.
"""
COMMON = ("--config", "--json", "--help")


def page() -> str:
    """Return the page."""
    parts = [HEAD, "## Commands\n"]
    listed = (
        (f"[`{' '.join(path)}`](#{'-'.join(path)})", plain(command.get_short_help_str(200)))
        for path, command in every(main)
    )
    parts.append(table(("command", "does"), listed))
    parts += [_section(path, command) for path, command in every(main)]
    return "\n".join(parts)


def every(
    group: click.Group, above: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    """Yield each command with the words that call it, groups before what is in them."""
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        if command is None or command.hidden:
            continue
        yield (*above, name), command
        if isinstance(command, click.Group):
            yield from every(command, (*above, name))


def _section(path: tuple[str, ...], command: click.Command) -> str:
    """Return one command's usage, text, arguments and options."""
    name = " ".join(path)
    context = click.Context(command, info_name=f"legato {name}")
    usage = " ".join(["legato", name, *command.collect_usage_pieces(context)])
    parts = [f"### {name}\n", f"```text\n{usage}\n```\n"]
    parts.append(_text(command.help or ""))
    rows = []
    for parameter in command.get_params(context):
        record = parameter.get_help_record(context)
        if record is not None and not set(parameter.opts) & set(COMMON):
            rows.append((f"`{record[0]}`", plain(record[1])))
    if rows:
        parts.append(table(("option", "means"), rows))
    shown = "\n".join(f"- `{line}`: {plain(text)}" for line, text in EXAMPLES.get(name, ()))
    if shown:
        parts.append(f"For example:\n\n{shown}\n")
    more = (command.epilog or "").replace(EPILOG, "").strip()
    if more:
        parts.append(_text(more))
    return "\n".join(parts)


def _text(text: str) -> str:
    """Return help text in Markdown: paragraphs, and what click must not wrap as it stands."""
    parts = []
    for part in re.split(r"\n\s*\n", python_clean(text)):
        if part.startswith("\b"):
            block = part.removeprefix("\b").strip("\n")
            parts.append(f"```text\n{block}\n```")
        else:
            parts.append(plain(" ".join(part.split())))
    return "\n\n".join(parts) + "\n"


def python_clean(text: str) -> str:
    """Return text without the indentation of its docstring."""
    import inspect

    return inspect.cleandoc(text.replace("\f", ""))
