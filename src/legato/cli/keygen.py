"""`legato keygen`: a new key pair for the daemon or for one of its clients."""

from pathlib import Path

import click

from legato.cli.command import Context, command
from legato.cli.exits import Exit, Failure

ROLES = ("observer", "stopper", "operator", "server")


@command("keygen")
@click.option("--name", required=True, help="Who has the key: it is in every record and log line.")
@click.option(
    "--role",
    required=True,
    type=click.Choice(ROLES),
    help="observer reads, stopper may also stop, operator acts; server is the daemon's own.",
)
@click.option(
    "--out",
    default=Path(),
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder for the two files; by default this one.",
)
def keygen(context: Context, name: str, role: str, out: Path) -> None:
    """Make a key pair: NAME.secret, for its owner's eyes alone, and NAME.public.

    A client's public file goes into the daemon's server.curve.clients; the daemon's own goes to
    each client, as server.server_public.
    """
    from legato.daemon.keys import make_keys

    try:
        secret, public = make_keys(out, name, role)
    except ValueError as error:
        raise Failure(str(error), Exit.USAGE) from error
    except FileExistsError as error:
        hint = "take another name, or remove both files if nobody uses the key"
        raise Failure(f"{error.filename} exists already", Exit.FAILED, hint) from error
    context.output.document(
        {"name": name, "role": role, "secret": str(secret), "public": str(public)}
    )
    context.output.say(f"{secret} (mode 0600) and {public}")
    key = "server.curve.secret" if role == "server" else "server.client_secret"
    goes = (
        "to each client, as server.server_public"
        if role == "server"
        else ("into the daemon's server.curve.clients; then restart the daemon")
    )
    context.output.note(f"name the secret in {key}; the public file goes {goes}")
