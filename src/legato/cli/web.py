"""`legato web`: the live page, served to this machine's browsers."""

import click

from legato.cli.command import Context, command
from legato.cli.exits import Exit, Failure

PORT = 5765


@command("web")
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=PORT,
    show_default=True,
    help="On loopback; 0 takes a free one.",
)
@click.option("--observe", is_flag=True, help="Let no page act, whoever opens it.")
def web(context: Context, port: int, observe: bool) -> None:
    """Serve the live page until Ctrl-C, and print its address.

    Whoever opens the address with its token may act; without the token a page only looks on. It
    reads pictures and reports from records.state_dir, so it runs on the daemon's machine.
    """
    from legato.config.load import load
    from legato.web.serve import serve
    from legato.web.setup import setup_of

    def ready(address: str, token: str | None) -> None:
        link = address if token is None else f"{address}#token={token}"
        context.output.line({"url": link, "address": address, "token": token})
        context.output.say(link)

    setup = setup_of(load(context.config, need_intrinsics=False))
    try:
        serve(setup, port, observe=observe, ready=ready)
    except OSError as error:
        hint = "another `legato web` may run; give another --port"
        raise Failure(f"port {port}: {error.strerror}", Exit.FAILED, hint) from error
    except KeyboardInterrupt:
        return
