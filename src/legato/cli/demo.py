"""`legato demo`: the whole job on the simulated cell, by the real daemon over its real line."""

import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
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
    from legato.records.store import Store, Summary
    from legato.report.score import Score

PREFIX = ".demo-"
DECIMALS = 6  # of the document's figures


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
    store = Store(state_dir)
    refuse_real_records(store)
    with own_files(store) as (config, log):
        derive(shipped, config, state_dir, seed, engine)
        loaded = load(config)
        with daemon(config, log) as (_, client):
            ended = job(context, loaded, client)
        record = store.read(ended.session)
        page = write_report(record, record.path / "report.html")
        show(context, ended, record, score(record), page)
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


def refuse_real_records(store: "Store") -> None:
    """Raise Failure where a real cell keeps its records: its fault and its arm's place stay.

    Told by state.json, by the latest session, and by the sessions of the fault or without an end.
    """
    from legato.records.errors import RecordError

    state: dict[str, Any] = {}
    with suppress(RecordError):  # the daemon begins anew where it cannot be read
        state = store.load_state()
    found = store.sessions()
    fault = state.get("fault")
    fault = fault if isinstance(fault, dict) else {}
    latest = [s for s in found[:1] if is_real(s)]
    held = [s for s in found if is_real(s) and (s.outcome is None or s.id == fault.get("session"))]
    if state.get("simulated") is False or held or latest:
        whose = f", such as session {(held + latest)[0].id}" if held or latest else ""
        text = f"{store.state_dir} has the records of a real cell{whose}"
        hint = "keep the demo's records elsewhere: --out DIR"
        raise Failure(text, Exit.USAGE, hint)


def is_real(session: "Summary") -> bool:
    """Say whether a session was of a real cell; a damaged one does not tell."""
    return not session.simulated and session.job != "unknown"


@contextmanager
def own_files(store: "Store") -> Iterator[tuple[Path, Path]]:
    """Give the paths of this demo's configuration and log; they go however it ends.

    Where a session began they move to its folder, so that the run can be repeated.
    """
    from legato.records.errors import RecordError

    sweep(store.state_dir)
    config = store.state_dir / f"{PREFIX}{os.getpid()}.toml"
    log = config.with_suffix(".log")
    before = {s.id for s in store.sessions()}
    try:
        yield config, log
    finally:
        with suppress(OSError, RecordError):
            begun = [s.id for s in store.sessions() if s.id not in before]
            for file, name in ((config, "demo.toml"), (log, "daemon.log")):
                if begun and file.exists():
                    file.replace(store.folder / begun[0] / name)
        for file in (config, log):
            file.unlink(missing_ok=True)


def sweep(folder: Path) -> None:
    """Remove the files of demos that were killed: their process is no more."""
    for file in folder.glob(f"{PREFIX}*"):
        pid = file.stem.removeprefix(PREFIX)
        if pid.isdecimal() and not Path("/proc", pid).exists():
            file.unlink(missing_ok=True)


def derive(
    loaded: "Loaded", path: Path, state_dir: Path, seed: int | None, engine: str | None
) -> None:
    """Write the configuration of this demo."""
    from legato.config.toml import dumps

    data = {name: dict(table) for name, table in loaded.data.items()}
    for name in ("requests", "events", "stop"):
        data["server"][name] = "tcp://127.0.0.1:*"
    data["records"]["state_dir"] = str(state_dir)
    if seed is not None:
        data["sim"]["seed"] = seed
    if engine is not None:
        data["calibration"]["engine"] = engine
    path.write_text(dumps(data, f"Made by `legato demo` from {loaded.path}."), encoding="utf-8")


def job(context: Context, loaded: "Loaded", client: "Client") -> Ended:
    """Return how the job ended: the arm is referenced, then the whole job is run and followed.

    A fault that an earlier session left is reset: a simulated world begins anew with its daemon,
    and its arm with it. So the arm is referenced where that world truly puts it.
    """
    out, sim = context.output, loaded.config.sim
    fault = client.call("status").get("fault")
    if fault:
        out.note(f"left by an earlier session, and reset: {fault.get('text')}")
        client.call("reset")
    client.call(
        "reference",
        xyz_mm=list(sim.arm_at_mm),
        pitch_deg=sim.arm_pitch_deg,
        roll_deg=sim.arm_roll_deg,
    )
    began = time.monotonic()
    session = str(client.call("run")["session"])
    out.note(f"run: session {session}, simulated cell, seed {sim.seed}")
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
    out.document(rounded(document))
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


def rounded(value: Any) -> Any:
    """Return JSON-able data with its numbers to `DECIMALS`."""
    match value:
        case float():
            return round(value, DECIMALS)
        case Mapping():
            return {key: rounded(inner) for key, inner in value.items()}
        case list():
            return [rounded(inner) for inner in value]
    return value
