"""`legato demo`: the whole job on the simulated cell, by the real daemon over its real line."""

import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from legato.cli.child import daemon
from legato.cli.command import Context, command
from legato.cli.exits import Exit, Failure, exit_of
from legato.cli.follow import follow
from legato.cli.sessions import states_of
from legato.cli.solve import ENGINES

if TYPE_CHECKING:
    from legato.config.load import Loaded
    from legato.daemon.client import Client
    from legato.records.record import SessionRecord
    from legato.report.score import Score

PREFIX = ".demo-"


@dataclass(frozen=True)
class Ended:
    """How the job ended and how long it took."""

    session: str
    outcome: str
    reason: str | None
    seconds: float


@command("demo")
@click.option("--seed", type=click.IntRange(min=0), help="Draws another leg pose and noise.")
@click.option("--engine", type=click.Choice(ENGINES), help="Default: calibration.engine.")
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    help="Where the records go; by default records.state_dir.",
)
def demo(context: Context, seed: int | None, engine: str | None, out: Path | None) -> None:
    """Run the whole job on the simulated cell and write its report.

    Starts a daemon of its own, references the arm, runs the job, shows each station against the
    simulated truth, and ends the daemon. Ends with the job's outcome.
    """
    from legato.config.load import load
    from legato.records.store import Store
    from legato.report.html import write_report
    from legato.report.score import score

    shipped = load(context.config)
    state_dir = prepared(shipped, out)
    config = derived(shipped, state_dir, seed, engine)
    loaded = load(config)
    log = config.with_suffix(".log")
    record: SessionRecord | None = None
    try:
        with daemon(config, log) as (_, client):
            ended = job(context, loaded, client)
        record = Store(state_dir).read(ended.session)
        page = write_report(record, record.path / "report.html")
        show(context, ended, record, score(record), page)
    finally:
        keep(config, log, record)
    code = exit_of(ended.outcome)
    if code != Exit.DONE:
        context.end(code)


def prepared(loaded: "Loaded", out: Path | None) -> Path:
    """Return the folder of the records, made; raises Failure unless the whole cell is simulated."""
    config = loaded.config
    if config.robot.driver != "sim" or config.camera.driver != "sim":
        hint = "give --config a simulated cell, or none"
        raise Failure("demo moves no real arm: this cell is real", Exit.USAGE, hint)
    state_dir = out.resolve() if out is not None else Path(config.records.state_dir)
    state_dir.mkdir(parents=True, exist_ok=True)
    return state_dir


def derived(loaded: "Loaded", state_dir: Path, seed: int | None, engine: str | None) -> Path:
    """Write the configuration of this demo and return its path."""
    from legato.config.toml import dumps

    data = {name: dict(table) for name, table in loaded.data.items()}
    for name in ("requests", "events", "stop"):
        data["server"][name] = "tcp://127.0.0.1:*"
    data["records"]["state_dir"] = str(state_dir)
    if seed is not None:
        data["sim"]["seed"] = seed
    if engine is not None:
        data["calibration"]["engine"] = engine
    path = state_dir / f"{PREFIX}{os.getpid()}.toml"
    path.write_text(dumps(data, f"Made by `legato demo` from {loaded.path}."), encoding="utf-8")
    return path


def job(context: Context, loaded: "Loaded", client: "Client") -> Ended:
    """Return how the job ended: the arm is referenced, then the whole job is run and followed.

    A fault that an earlier session left is reset: a simulated world begins anew with its daemon.
    """
    out, home = context.output, loaded.config.robot.home
    fault = client.call("status").get("fault")
    if fault:
        out.note(f"left by an earlier session, and reset: {fault.get('text')}")
        client.call("reset")
    client.call(
        "reference",
        xyz_mm=list(home.xyz_mm),
        pitch_deg=home.pitch_deg,
        roll_deg=home.roll_deg,
    )
    began = time.monotonic()
    session = str(client.call("run")["session"])
    out.note(f"run: session {session}, simulated cell, seed {loaded.config.sim.seed}")
    answer = follow(client, session, out)
    return Ended(session, str(answer["outcome"]), answer.get("reason"), time.monotonic() - began)


def show(
    context: Context, ended: Ended, record: "SessionRecord", found: "Score", page: Path
) -> None:
    """Show the stations against the simulated truth, the outcome and the report's path."""
    out, pose = context.output, found.pose_error
    document: dict[str, Any] = {
        "outcome": ended.outcome,
        "reason": ended.reason,
        "session": ended.session,
        "states": states_of(record),
        "stations": [
            {
                "station_mm": s.station_mm,
                "contact_mm": s.contact_mm,
                "place_mm": s.place_mm,
                "error_mm": s.error_mm,
            }
            for s in found.stations
        ],
        "pose_error": None
        if pose is None
        else {"rotation_deg": pose.rotation_deg, "translation_mm": pose.translation_mm},
        "seconds": ended.seconds,
        "report": str(page),
    }
    out.document(document)
    columns = ("station mm", "predicted z mm", "touched z mm", "along the leg mm", "error mm")
    rows = [
        (f"{s.station_mm:g}", s.predicted_z_mm, s.touched_z_mm, s.place_mm, s.error_mm)
        for s in found.stations
    ]
    out.table(columns, rows)
    if pose is not None:
        out.say(
            f"leg's pose off by {pose.rotation_deg:.3f} deg and {pose.translation_mm:.3f} mm "
            "from the simulated truth"
        )
    for touch in found.stray:
        out.say(f"touched outside every stroke: {touch.get('surface')}")
    for breach in found.breaches:
        out.say(f"breach: {breach.get('what')}")
    reason = f": {ended.reason}" if ended.reason else ""
    out.say(f"{ended.outcome}{reason}, {ended.seconds:.1f} s")
    out.say(f"report: {page}")


def keep(config: Path, log: Path, record: "SessionRecord | None") -> None:
    """Move configuration and log to the session's folder, so that the run can be repeated.

    Without a session the log stays where it is, and the configuration goes.
    """
    if record is None:
        config.unlink(missing_ok=True)
        return
    config.replace(record.path / "demo.toml")
    if log.exists():
        log.replace(record.path / "daemon.log")
