"""The log: JSON lines where nobody looks, colours where somebody does."""

import io
import json

from legato.daemon.log import make_log


class Terminal(io.StringIO):
    """A stream that a person watches."""

    def isatty(self) -> bool:
        """Say that it is one."""
        return True


def test_a_pipe_gets_one_json_document_a_line() -> None:
    """Event, fields, level and time are in it; debug is left out."""
    out = io.StringIO()
    log = make_log(out)
    log.info("press", station_mm=67, contact_mm=0.4)
    log.debug("hidden")
    log.error("fault", cause="estop", text="two\nlines")
    first, second = (json.loads(line) for line in out.getvalue().splitlines())
    assert (first["event"], first["level"], first["station_mm"]) == ("press", "info", 67)
    assert first["timestamp"].endswith("Z")
    assert second["text"] == "two\nlines"


def test_a_terminal_gets_colours() -> None:
    """People read lines, not JSON."""
    out = Terminal()
    make_log(out).info("ready", requests="tcp://127.0.0.1:5760")
    assert "\x1b[" in out.getvalue()
    assert "ready" in out.getvalue()


def test_a_line_that_nobody_takes_is_lost() -> None:
    """A full disk behind stderr, or a reader that has gone, stops no daemon."""

    class Full(io.StringIO):
        def write(self, _: str) -> int:
            raise OSError(28, "No space left on device")

    log = make_log(Full())
    log.info("state", state="idle")
    log.error("fault", cause="disk")
    closed = io.StringIO()
    closed.close()
    make_log(closed).warning("turned_away")
