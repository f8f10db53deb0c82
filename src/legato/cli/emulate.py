"""`legato emulate`: a TeachMover that is not there, on a serial port of the kernel's making."""

import json
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from legato.cli.command import Context, command
from legato.cli.exits import Exit, Failure
from legato.cli.link import check_link, kept, relink
from legato.cli.numbers import Number

if TYPE_CHECKING:
    from legato.config.load import Loaded
    from legato.drivers.emulator import Emulator, Fault
    from legato.drivers.sim.arm import SimArm

BAUDS = ("110", "150", "300", "600", "1200", "2400", "4800", "9600")
FAULTS = """\b
Faults: silence, late, garbage, 0 (refused), 2 (STOP on the pendant), hang-up,
restart, lost-steps, stuck-open, stuck-closed. Keys, joined by commas:
  after=N commands, at=SECONDS, or p=PROBABILITY of each command
  on=step (default), read or any: which commands count
  by=seconds late or away, or half-steps lost; motor=1..6 that loses them
For example: --fault silence:after=40 --fault lost-steps:after=90,by=40,motor=3
"""
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)


@command("emulate", epilog=FAULTS)
@click.option(
    "--time-scale",
    type=Number(min=0, min_open=True),
    default=1.0,
    show_default=True,
    help="Seconds of the cell in one of yours.",
)
@click.option("--baud", type=click.Choice(BAUDS), help="Default: robot.baud.")
@click.option(
    "--fault",
    "faults",
    multiple=True,
    metavar="KIND[:KEY=VALUE,...]",
    help="What goes wrong; may be given again.",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Draws the faults' chances.",
)
@click.option(
    "--link",
    type=click.Path(path_type=Path),
    help="Keep a symbolic link to the port here, also when it is plugged in anew.",
)
@click.option(
    "--truth",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Write what truly happened here at the end and at SIGUSR1.",
)
@click.option(
    "--line",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Write every chunk on the line here: monotonic seconds, > to the arm or < from it, bytes.",
)
def emulate(
    context: Context,
    time_scale: float,
    baud: str | None,
    faults: tuple[str, ...],
    seed: int,
    link: Path | None,
    truth: Path | None,
    line: Path | None,
) -> None:
    """Speak the TeachMover's protocol on a pseudo-terminal, over the simulated arm.

    Prints the port's path and runs until Ctrl-C or SIGTERM. The line takes its true time, and a
    reply comes after the motion. The arm stands in the world that [sim] draws: a daemon of the
    same configuration with robot.driver = "teachmover" and camera.driver = "sim" sees the leg
    that this arm touches. Its registers stand at zero where [sim] puts the arm: reference it there.
    """
    from legato.config.load import load

    parsed = parsed_faults(faults)
    for place in filter(None, (link, truth)):
        if not place.parent.is_dir():
            raise Failure(f"{place.parent} is no folder", Exit.USAGE, "make it, or name another")
    if link is not None:
        check_link(link)
    loaded = load(context.config, need_intrinsics=False)
    stopping = threading.Event()
    arm, emulator = build(loaded, time_scale, int(baud) if baud else None, parsed, seed, stopping)
    told = Told(context, arm, emulator, link, truth)
    with signals() as next_signal, tapped(line) as passed, kept(link):
        try:
            run(told, passed, stopping, next_signal)
        finally:
            told.unlink()


def parsed_faults(texts: tuple[str, ...]) -> tuple["Fault", ...]:
    """Return the faults that texts spell; raises click.BadParameter."""
    from legato.drivers.emulator import fault

    try:
        return tuple(fault(text) for text in texts)
    except ValueError as error:
        raise click.BadParameter(str(error), param_hint="--fault") from error


def build(
    loaded: "Loaded",
    time_scale: float,
    baud: int | None,
    faults: tuple["Fault", ...],
    seed: int,
    stopping: threading.Event,
) -> tuple["SimArm", "Emulator"]:
    """Return the simulated arm of a configuration and the controller that moves it.

    No wait lasts longer than until `stopping` is set.
    """
    from legato.config.build import arm_model, leg
    from legato.drivers.emulator import Emulator, Faults
    from legato.drivers.sim.arm import SimArm
    from legato.drivers.sim.clock import SimClock
    from legato.drivers.sim.world import World

    config, robot = loaded.config, loaded.config.robot
    clock = SimClock(time_scale, sleep=lambda seconds: void(stopping.wait(seconds)))
    arm = SimArm(World(config.sim, leg(config), arm_model(config), clock, config.cell.table_z_mm))
    arm.open()
    emulator = Emulator(
        arm,
        clock,
        switch_mask=robot.switch_mask,
        switch_active_low=robot.switch_active_low,
        baud=baud if baud is not None else robot.baud,
        faults=Faults(faults, seed),
    )
    return arm, emulator


def void(_: object) -> None:
    """Return nothing of a value that nobody wants."""


@dataclass
class Told:
    """What the outside is told: the port's path, the link to it, and the truth."""

    context: Context
    arm: "SimArm"
    emulator: "Emulator"
    link: Path | None
    truth: Path | None
    ports: list[str] = field(default_factory=list)

    def port(self, path: str) -> None:
        """Tell the path of a port that was just plugged in; only the first is a result."""
        if self.link is not None:
            relink(self.link, path)
        shown = str(self.link) if self.link is not None else path
        if self.ports:
            self.context.output.note(f"plugged in again: {path}")
        else:
            self.context.output.say(shown)
            self.context.output.line({"port": shown})
        self.ports.append(path)

    def happened(self) -> None:
        """Write the truth so far to its file, or without one to stdout as a JSON line."""
        told: dict[str, Any] = {"simulated": True, "ports": self.ports}
        told |= self.arm.testimony() | {"account": self.emulator.account()}
        if self.truth is not None:
            replace(self.truth, json.dumps(told, indent=1) + "\n")
            self.context.output.note(f"truth: {self.truth}")
        elif self.context.output.as_json:
            self.context.output.line({"truth": told})
        else:
            self._summary(told)

    def unlink(self) -> None:
        """Take the link away where it is ours."""
        if self.link is None or not self.ports or not self.link.is_symlink():
            return
        if str(self.link.readlink()) == self.ports[-1]:
            self.link.unlink()

    def _summary(self, told: dict[str, Any]) -> None:
        """Say to a person what happened."""
        counts = told["account"]["commands"]
        self.context.output.say(
            f"{counts['step']} motions, {counts['read']} reads, {len(told['touches'])} touches, "
            f"{len(told['breaches'])} breaches, {len(told['account']['faults'])} faults struck"
        )
        for breach in told["breaches"]:
            self.context.output.say(f"breach: {breach['what']}")


@contextmanager
def tapped(file: Path | None) -> Iterator[Callable[[str, bytes], None]]:
    """Give what writes each chunk on the line to a file, at once; nothing where there is none."""
    if file is None:
        yield lambda _, __: None
        return
    try:
        stream = file.open("w", encoding="utf-8", buffering=1)
    except OSError as error:
        raise Failure(f"cannot write {file}: {error}", Exit.USAGE, "name another --line") from error
    with stream:
        yield lambda way, data: void(stream.write(f"{time.monotonic():.6f} {way} {data!r}\n"))


def run(
    told: Told,
    passed: Callable[[str, bytes], None],
    stopping: threading.Event,
    next_signal: Callable[[], int],
) -> None:
    """Serve the line on a thread of its own until a signal ends it; tell the truth at the end.

    SIGINT and SIGTERM end it, and at each SIGUSR1 the truth so far is told.
    """
    from legato.drivers.emulator import PseudoTerminal

    with PseudoTerminal(told.emulator, told.port, passed) as line:
        thread = threading.Thread(target=line.serve, name="line")
        thread.start()
        try:
            while next_signal() == signal.SIGUSR1:
                with line.busy:
                    told.happened()
        finally:
            stopping.set()
            line.stop()
            thread.join()
        told.happened()


@contextmanager
def signals() -> Iterator[Callable[[], int]]:
    """Give a wait for the next of SIGNALS, whichever thread it reaches the process on."""
    receive, send = os.pipe()
    os.set_blocking(send, False)
    before = {number: signal.signal(number, lambda *_: None) for number in SIGNALS}
    wake = signal.set_wakeup_fd(send)
    try:
        yield lambda: os.read(receive, 1)[0]
    finally:
        signal.set_wakeup_fd(wake)
        for number, handler in before.items():
            signal.signal(number, handler)
        os.close(receive)
        os.close(send)


def replace(file: Path, text: str) -> None:
    """Write a file as a whole: a reader sees the old one or the new one."""
    fresh = file.with_name(f".{file.name}.{os.getpid()}")
    fresh.write_text(text, encoding="utf-8")
    fresh.replace(file)
