"""What every command has: `--config`, `--json`, exit codes in `--help`, errors without traceback.

Only an error that nobody foresaw, a bug, shows its traceback, and ends with 1.
"""

import sys
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from legato.cli.examples import write_examples
from legato.cli.exits import EPILOG, REFUSALS, Exit, Failure
from legato.cli.output import Output, write_error

if TYPE_CHECKING:
    from legato.daemon.client import Client
    from legato.daemon.keys import Keys


def connect(requests: str, events: str | None, keys: "Keys | None" = None) -> "Client":
    """Return a client of the daemon at two endpoints, encrypted where there are keys."""
    from legato.daemon.client import Client

    return Client(requests, events, keys=keys)


@dataclass(frozen=True)
class Services:
    """What commands use of the outside; handed in as click's object, so that tests can too."""

    connect: Callable[..., "Client"] = connect


@dataclass(frozen=True)
class Context:
    """What a command is given: the configuration's path, if any, and where its words go."""

    config: Path | None
    output: Output
    services: Services

    def end(self, code: Exit) -> NoReturn:
        """End the command with a code."""
        raise click.exceptions.Exit(int(code))


class LegatoCommand(click.Command):
    """A click command whose foreseen errors are one line with what to do."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        kwargs["epilog"] = "\n\n".join(filter(None, [kwargs.get("epilog"), EPILOG]))
        super().__init__(*args, **kwargs)

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the command's examples, then what every command ends with."""
        write_examples(ctx, formatter)
        super().format_epilog(ctx, formatter)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; every error ends with a code of `Exit`."""
        try:
            return super().invoke(ctx)
        except (click.exceptions.Exit, click.UsageError):
            raise
        except (KeyboardInterrupt, click.Abort):
            self._end(ctx, Failure("interrupted"))
        except Exception as error:  # noqa: BLE001  # the boundary: a bug is shown, then exit 1
            failure = foreseen(error)
            if failure is None:
                traceback.print_exc()
                failure = Failure(
                    f"a bug: {type(error).__name__}: {error}",
                    Exit.FAILED,
                    "report it with the lines above",
                )
            self._end(ctx, failure)

    @staticmethod
    def _end(ctx: click.Context, failure: Failure) -> NoReturn:
        """Say a failure and end with its code."""
        write_error(
            sys.stderr,
            failure.text,
            failure.hint,
            failure.code,
            as_json=bool(ctx.params.get("as_json")),
            stdout=sys.stdout,
        )
        ctx.exit(failure.code)


def foreseen(error: Exception) -> Failure | None:
    """Return the failure that an error means to a person, or None for a bug."""
    from legato.calibration.problem import CalibrationError
    from legato.config.errors import ConfigError
    from legato.daemon.client import DaemonUnavailable, RpcError
    from legato.hal.faults import DeviceError
    from legato.records.errors import RecordError
    from legato.vision.marks import MarksNotFound
    from legato.vision.picture import PictureError

    match error:
        case Failure():
            return error
        case ConfigError():
            return Failure(str(error), Exit.USAGE)
        case DaemonUnavailable():
            hint = "start it with `legato serve`, or see that --config is the daemon's own"
            return Failure(str(error), Exit.NO_DAEMON, hint)
        case RpcError():
            return refused(error.code, error.message, error.data)
        case DeviceError():
            return Failure(f"{error.cause}: {error.text}", Exit.FAULT, error.hint)
        case MarksNotFound() | CalibrationError() | RecordError():
            return Failure(error.text, Exit.FAILED, error.hint)
        case PictureError():
            return Failure(str(error))
        case OSError():
            place = f"{error.filename}: " if error.filename else ""
            return Failure(f"{place}{error.strerror or error}")
        case _:
            return None


def refused(code: int, message: str, data: Any) -> Failure:
    """Return the failure of a request that the daemon answered with an error."""
    data = data if isinstance(data, Mapping) else {}
    reason = str(data.get("reason") or "")
    text = message if reason in ("", message) else f"{message}: {reason}"
    state = f" (state {data['state']})" if data.get("state") else ""
    return Failure(text + state, REFUSALS.get(code, Exit.FAILED), str(data.get("hint") or ""))


def command(name: str, **kwargs: Any) -> Callable[[Callable[..., Any]], click.Command]:
    """Make a function a command; it gets a `Context` first, then its own options."""

    def make(function: Callable[..., Any]) -> click.Command:
        @wraps(function)
        def run(config: Path | None, as_json: bool, **options: Any) -> Any:
            services = click.get_current_context().find_object(Services) or Services()
            return function(Context(config, Output(as_json=as_json), services), **options)

        wrapped = _config_option(_json_option(run))
        return click.command(name, cls=LegatoCommand, **kwargs)(wrapped)

    return make


_config_option = click.option(
    "--config",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Configuration; by default the shipped simulated cell's.",
)
_json_option = click.option(
    "--json", "as_json", is_flag=True, help="Print one JSON document on stdout."
)
