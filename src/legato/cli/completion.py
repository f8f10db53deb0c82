"""`legato completion`: what makes a shell complete legato's commands, options and sessions."""

import click

from legato.cli.command import Context, command

PROGRAM = "legato"
WHERE = {
    "bash": "~/.local/share/bash-completion/completions/legato",
    "zsh": "a folder of $fpath, as _legato",
    "fish": "~/.config/fish/completions/legato.fish",
}


@command("completion")
@click.argument("shell", type=click.Choice(tuple(WHERE)))
def completion(context: Context, shell: str) -> None:
    """Print the script with which SHELL completes legato's commands, options and sessions."""
    text = script(shell)
    context.output.document({"shell": shell, "script": text, "put_it_in": WHERE[shell]})
    if not context.output.as_json:
        click.echo(text)


def script(shell: str) -> str:
    """Return click's own script for a shell."""
    from click.shell_completion import get_completion_class

    root = click.get_current_context().find_root().command
    kind = get_completion_class(shell)
    if kind is None:
        raise click.UsageError(f"click has no completion for {shell}")
    made = kind(root, {}, PROGRAM, f"_{PROGRAM.upper()}_COMPLETE")
    return str(made.source_template % made.source_vars())
