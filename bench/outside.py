"""What befalls a daemon from outside: hanging devices, a freeze, a stepped clock, a full disk.

The freeze lasts its full 20 s, over the emulated arm. The wall clock is stepped for the daemon's
process alone, by a library that is compiled for it: what it loads before its own answers for the
time of day. The disk that fills up is a tmpfs of its own, where one may be mounted.
"""

import signal
import struct
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

from bench.row import Row
from tests.system import judge
from tests.system.attacked import SHORT, Attacked, attacked
from tests.system.emulated import Cell
from tests.system.line import Line, ready_to_massage
from tests.system.test_survive_line import TABLES

FREEZE_S = 20.0
DAY_S = 86_400
DAYS = (1, -1, 30, 0)
ANSWER_S = 1.0
ASIDE = [127.0, 60.0, 150.0]  # where the arm stands, so that home is a way off
CLOCK = """
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>
int clock_gettime(clockid_t id, struct timespec *at) {
    static volatile long *ahead;
    int failed = (int)syscall(SYS_clock_gettime, id, at);
    if (ahead == NULL) {
        int file = open(getenv("LEGATO_CLOCK"), O_RDONLY | O_CLOEXEC);
        ahead = mmap(NULL, sizeof(long), PROT_READ, MAP_SHARED, file, 0);
        close(file);
    }
    if (id == CLOCK_REALTIME) at->tv_sec += *ahead;
    return failed;
}
"""
"""The wall clock of one process, ahead by what a file says; the others stay as they are."""


@contextmanager
def over_the_line(folder: Path, scale: float = 40.0) -> Iterator[tuple[Attacked, Cell]]:
    """Give a daemon and the emulator that it drives."""
    emulator = Cell(folder, tables=TABLES, scale=scale)
    try:
        with attacked(folder, TABLES) as cell:
            yield cell, emulator
    finally:
        emulator.end()


def deadlines() -> Iterator[Row]:
    """Hold a daemon up for longer than its states may last: a camera, then an arm that hangs."""
    faults = [
        {"kind": "slow_grab", "call": 1, "by": 26.0},
        {"kind": "arm_blocks", "call": 1, "by": 38.0},
    ]
    wrong, late = [], []
    with (
        tempfile.TemporaryDirectory() as name,
        attacked(Path(name), SHORT, time_scale=1.0, faults=faults, arm_at_mm=ASIDE) as cell,
    ):
        line, stops = Line(cell.lines["requests"]), Line(cell.lines["stop"])
        line.do("capture")
        wrong += held_up(line, "capture", 20.0, late)
        while "error" in line.ask("reset"):
            time.sleep(0.5)
        line.do("home")
        time.sleep(1.0)
        told = stops.do("stop", timeout_s=0.3)
        wrong += ["a stop was confirmed"] if told["confirmed"] is not None else []
        wrong += held_up(line, "stopping", 30.0, late)
        while "error" in line.ask("reset"):
            time.sleep(0.5)
        line.close()
        stops.close()
        wrong += judge.records(judge.folders(cell.state_dir))
    yield Row("abuse: states held up past their deadline", 2, "", note="; ".join(wrong))
    yield Row("abuse: deadlines that did not end in fault", len(wrong), "", 0)
    yield Row("abuse: status while a device hangs, worst", 1e3 * max(late), "ms", 1e3 * ANSWER_S)


def held_up(line: Line, state: str, limit_s: float, late: list[float]) -> Iterator[str]:
    """Yield what is wrong with how a state ends that is held up."""
    began = time.monotonic()
    status = line.do("status")
    while status["state"] == state:
        asked = time.monotonic()
        status = line.do("status")
        late.append(time.monotonic() - asked)
        time.sleep(0.05)
    lasted = time.monotonic() - began
    if not limit_s - 2.0 < lasted < limit_s + 2.0:
        yield f"{state} lasted {lasted:.1f} s"
    if status["fault"] is None or status["fault"]["cause"] != "deadline":
        yield f"{state} ended in {status['state']}: {status['fault']}"


def frozen() -> Iterator[Row]:
    """Freeze a daemon for 20 s: it goes on, or pauses for the operator whose lease has ended."""
    with tempfile.TemporaryDirectory() as name, over_the_line(Path(name)) as (cell, emulator):
        line = Line(cell.lines["requests"])
        ready_to_massage(line, lambda: emulator.truth()["tip"])
        late, wrong = [], []
        for job, state, leased, wanted in (
            ("massage", "massage_7", False, "done"),
            ("massage", "massage_7", True, "paused"),
            ("home", "move_home", False, "done"),
        ):
            lease = line.do("lease", duration_s=5.0, deadman=True)["lease"] if leased else None
            session = line.do(job, **({"lease": lease} if lease else {}))["session"]
            while line.do("status")["state"] not in (state, "idle"):
                time.sleep(0.005)
            late.append(freeze(cell, line))
            time.sleep(0.5)
            ended = line.do("status")["state"] if leased else line.outcome(session)
            wrong += [f"{job}: {ended}, not {wanted}"] if ended != wanted else []
            line.ask("stop")
            line.outcome(session)
        referenced = line.do("status")["arm"]["referenced"]
        wrong += [] if referenced else ["the arm is not referenced any more"]
        paths = judge.folders(cell.state_dir)
        wrong += [*judge.records(paths)]
        wrong += [*judge.on_the_line([t for t, _ in emulator.motions()], paths)]
        line.close()
    yield Row("abuse: freezes of 20 s", len(late), "", note="; ".join(wrong))
    yield Row("abuse: freezes that did not end as designed", len(wrong), "", 0)
    yield Row("abuse: answered after a freeze, worst", max(late), "s", ANSWER_S)


def freeze(cell: Attacked, line: Line) -> float:
    """Freeze the process; return how long it takes to answer once it goes on."""
    cell.send_signal(signal.SIGSTOP)
    time.sleep(FREEZE_S)
    asked = line.send("status")
    cell.send_signal(signal.SIGCONT)
    began = time.monotonic()
    line.answer(asked)
    return time.monotonic() - began


def stepped() -> Iterator[Row]:
    """Step the wall clock by a day, on and back, in the middle of jobs."""
    with tempfile.TemporaryDirectory() as name:
        source, library = Path(name) / "clock.c", Path(name) / "clock.so"
        source.write_text(CLOCK, encoding="ascii")
        compiled = ["cc", "-shared", "-fPIC", "-O2", "-o", str(library), str(source)]
        subprocess.run(compiled, check=True)
        step = Path(name) / "ahead"
        step.write_bytes(bytes(8))
        preload = {"LD_PRELOAD": str(library), "LEGATO_CLOCK": str(step)}
        folder = Path(name) / "cell"
        with attacked(folder, SHORT, environment=preload, time_scale=10.0) as cell:
            line = Line(cell.lines["requests"])
            wrong = [*steps(cell, line, step)]
            line.close()
            wrong += [*judge.records(judge.folders(cell.state_dir), wall=False)]
    yield Row("abuse: wall clock stepped in a pass", len(DAYS), "", note="; ".join(wrong))
    yield Row("abuse: steps that did harm", len(wrong), "", 0)


def steps(cell: Attacked, line: Line, step: Path) -> Iterator[str]:
    """Yield what a stepped clock has done to jobs, lease, heartbeat and records."""
    ready_to_massage(line)
    kept = len(line.do("sessions", limit=50)["sessions"])
    for days in DAYS:
        session = line.do("massage")["session"]
        lease = line.do("lease", duration_s=60.0)["lease"]
        while line.do("status")["state"] != "massage_7":
            time.sleep(0.005)
        began, up = time.monotonic(), line.do("status")["uptime_s"]
        with step.open("r+b") as file:
            file.write(struct.pack("l", days * DAY_S))
        if line.outcome(session) != "done":
            yield f"{days:+d} d: {line.do('session', session=session)['reason']}"
        told = line.do("session", session=session)
        lasted = datetime.fromisoformat(told["ended"]) - datetime.fromisoformat(told["started"])
        if abs(lasted.total_seconds()) < DAY_S / 2:
            yield f"{days:+d} d: the step was not seen, {lasted}"
        drift = (line.do("status")["uptime_s"] - up) - (time.monotonic() - began)
        if abs(drift) > 0.5:
            yield f"{days:+d} d: uptime is off by {drift:.1f} s"
        if line.do("lease", duration_s=0.0, lease=lease)["lease"] is not None:
            yield f"{days:+d} d: the lease was not given back"
        kept += 1
        if len(line.do("sessions", limit=50)["sessions"]) != kept:
            yield f"{days:+d} d: a session is missing"
    if len(judge.folders(cell.state_dir)) != kept:
        yield "a record is missing"


def filled() -> Iterator[Row]:
    """Fill the disk under a running session: a fault, then refusals, then it goes on."""
    with tempfile.TemporaryDirectory() as name:
        place = Path(name) / "disk"
        place.mkdir()
        mount = ["mount", "-t", "tmpfs", "-o", "size=16m", "none", str(place)]
        if subprocess.run(mount, capture_output=True, check=False).returncode != 0:
            yield Row("abuse: disks filled", 0, "", note="a tmpfs may not be mounted here")
            return
        try:
            wrong = [*fill(place)]
        finally:
            subprocess.run(["umount", str(place)], check=True)
    yield Row("abuse: disks filled", 5, "", note="; ".join(wrong))
    yield Row("abuse: full disks that did not end as designed", len(wrong), "", 0)


def fill(place: Path) -> Iterator[str]:
    """Yield what was not as designed."""
    with attacked(place / "cell", SHORT, time_scale=20.0) as cell:
        line, stopper = Line(cell.lines["requests"]), place / "stopper"
        for after_s in (0.0, 0.1, 0.3, 0.6, 0.9):
            ready_to_massage(line)
            session = line.do("massage")["session"]
            time.sleep(after_s)
            flood(stopper)
            ended = line.outcome(session)
            status = line.do("status")
            cause = (status["fault"] or {}).get("cause")
            if (ended, cause) not in (("fault", "disk"), ("done", None)):
                yield f"{after_s} s: {ended}, {cause}"
            if status["arm"]["contact"]:
                yield f"{after_s} s: the arm stayed at the leg"
            line.ask("reset")
            if line.ask("home").get("error", {}).get("message") != "precondition":
                yield f"{after_s} s: a job began on a full disk"
            if line.do("estop")["state"] != "fault":
                yield f"{after_s} s: no estop"
            stopper.unlink()
            time.sleep(1.2)
        ready_to_massage(line)
        line.close()
        yield from judge.records(judge.folders(cell.state_dir))


def flood(path: Path) -> None:
    """Write until nothing goes on the disk any more."""
    with path.open("wb", buffering=0) as file:
        for size in (1 << 20, 1 << 12, 1):
            try:
                while file.write(bytes(size)):
                    pass
            except OSError:
                continue
