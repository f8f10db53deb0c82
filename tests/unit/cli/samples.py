"""A cell with its lens file, a runner of commands, and a client that plays a daemon."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from click.testing import CliRunner, Result

from legato.calibration.problem import KnownIntrinsics
from legato.cli.command import Services
from legato.cli.main import main
from legato.config.intrinsics import write_intrinsics
from legato.config.schema import Config
from legato.daemon.client import Client, DaemonUnavailable
from legato.geometry.projection import Intrinsics

TOML = """
[camera]
intrinsics = "lens.toml"
max_intrinsics_age_days = 36500.0

[cell]
camera_at_mm = {at}
camera_looks_at_mm = {to}

[records]
state_dir = "state"

[sim]
time_scale = 400.0
"""


def write_cell(folder: Path, more: str = "") -> Path:
    """Write a simulated cell whose camera is exactly known, and return its file."""
    sim = Config().sim
    file = folder / "cell.toml"
    at, to = list(sim.camera_at_mm), list(sim.camera_looks_at_mm)
    file.write_text(TOML.format(at=at, to=to) + more, encoding="utf-8")
    lens = Intrinsics(sim.alpha_u, sim.alpha_v, sim.u0, sim.v0, sim.k1, sim.k2, 768, 576)
    created = "2026-11-20T10:00:00+00:00"
    write_intrinsics(folder / "lens.toml", KnownIntrinsics(lens), views=20, rms_px=0.1,
                     created=created)  # fmt: skip
    return file


Event = tuple[str, dict[str, Any]]


@dataclass
class FakeDaemon:
    """Answers as told and remembers what was asked; `events` are given out once, in batches."""

    answers: Mapping[str, Any] = field(default_factory=dict)
    batches: Sequence[Sequence[Event]] = ()
    outcome: dict[str, Any] = field(default_factory=dict)
    on_event: Callable[[Event], None] = lambda _: None
    asked: list[tuple[str, dict[str, Any]]] = field(default_factory=list)
    closed: bool = False
    given: int = 0

    def call(self, method: str, **params: Any) -> Any:
        """Answer one request; an exception among the answers is raised."""
        self.asked.append((method, params))
        if method == "wait":
            ended = self.given >= len(self.batches)
            return {**self.outcome, "outcome": self.outcome["outcome"] if ended else None}
        answer = self.answers.get(method, {"state": "idle"})
        if isinstance(answer, Exception):
            raise answer
        return answer

    def events(self, timeout_s: float) -> Iterator[Event]:
        """Give the next batch of events."""
        del timeout_s
        if self.given >= len(self.batches):
            return
        self.given += 1
        for event in self.batches[self.given - 1]:
            self.on_event(event)
            yield event

    def close(self) -> None:
        """Remember that the line was let go."""
        self.closed = True

    @property
    def methods(self) -> list[str]:
        """What was asked, without the asking for the outcome."""
        return [method for method, _ in self.asked if method != "wait"]


def run(*args: str | Path, daemon: FakeDaemon | None = None, text: str | None = None) -> Result:
    """Run a command line; without a daemon nothing answers."""

    def connect(requests: str, events: str | None) -> Client:
        del events
        if daemon is None:
            raise DaemonUnavailable(f"no daemon answers at {requests}")
        return cast(Client, daemon)

    runner = CliRunner()
    return runner.invoke(main, [str(a) for a in args], obj=Services(connect), input=text)


def document(result: Result) -> Any:
    """Return the one JSON document of stdout."""
    lines = result.stdout.splitlines()
    assert len(lines) == 1, result.stdout
    return json.loads(lines[0])
