"""The real daemon with one job of its own: `home` tells progress so many times a second.

`python -m bench.metronome CONFIG RATE SECONDS`; all but the procedure is `legato serve`.
"""

import sys
import time
from collections.abc import Generator
from pathlib import Path
from typing import Any

from legato.config.load import load
from legato.control.effects import Dwell, Effect, Record
from legato.daemon.serve import serve

START_S = 0.5  # every subscriber is there by then


def main(config: str, rate: float, seconds: float) -> int:
    """Serve until told to end."""

    def procedure(*_: Any) -> Generator[Effect, Any, str]:
        yield Dwell(START_S)
        began = time.monotonic()
        for number in range(round(rate * seconds)):
            yield Dwell(began + number / rate - time.monotonic())
            yield Record("progress", {"text": "tick", "done": number, "sent": time.monotonic()})
        return "done"

    return serve(load(Path(config)), procedures=procedure)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], float(sys.argv[2]), float(sys.argv[3])))
