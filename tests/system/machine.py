"""A client that does anything at any moment to a real daemon whose devices go wrong, and a judge.

Hypothesis draws what it does. What the daemon answers is held against what was ever promised; when
an example ends, everything it has left on the disk is judged.
"""

import shutil
import signal
import sys
import time
import traceback
from collections import Counter, deque
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import zmq
from hypothesis import HealthCheck, Phase, settings
from hypothesis import seed as hypothesis_seed
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    rule,
    run_state_machine_as_test,
)

from legato.control.table import JOBS
from tests.system import judge, junk
from tests.system.attacked import Attacked, Line, brought_to_idle, ready_to_massage
from tests.system.emulated import HOME, Cell

STATIONS = (7.0, 67.0)
ANSWER_S = 5.0  # until status has to be answered, on a machine that is busy with something else
BUGS = ("bug", "worker_gone", "not_tidied")
TRAIL, KEPT_BYTES, KEPT_SESSIONS = 2000, 2_000_000, 8  # of what a violation leaves
KNOWN = {
    -32700, -32600, -32601, -32602, -32000, -32001, -32002, -32003, -32004, -32005, -32006,
}  # fmt: skip
CHANCES: tuple[tuple[str, float, dict[str, Any]], ...] = (
    ("arm_lost", 0.004, {"for_s": 5.0}),
    ("arm_lost", 0.004, {"on": "read"}),
    ("arm_timeout", 0.004, {}),
    ("arm_refused", 0.004, {}),
    ("arm_stopped_by_pendant", 0.004, {}),
    ("arm_blocks", 0.004, {"by": 40.0}),
    ("following_error", 0.004, {}),
    ("lost_steps", 0.004, {}),
    ("stuck_open", 0.002, {"for_s": 20.0}),
    ("stuck_closed", 0.002, {"for_s": 20.0}),
    ("early_contact", 0.004, {}),
    ("camera_lost", 0.03, {"for_s": 4.0}),
    ("camera_stale", 0.04, {}),
    ("blank", 0.03, {}),
    ("dark", 0.03, {}),
    ("slow_grab", 0.05, {"by": 20.0}),
)
SIM_FAULTS = [
    {"kind": kind, "p": p, "seed": seed, **more} for seed, (kind, p, more) in enumerate(CHANCES)
]
LINE_FAULTS = (
    "silence:p=0.005", "late:p=0.005,by=40", "garbage:p=0.005", "0:p=0.005", "2:p=0.005",
    "hang-up:p=0.004,by=0.1", "restart:p=0.004", "lost-steps:p=0.005,by=40",
    "silence:p=0.004,on=read",
)  # fmt: skip


class Ward:
    """The daemon that all examples share, and what is known of its life."""

    def __init__(
        self, cell: Attacked, emulator: Cell | None = None, evidence: Path | None = None
    ) -> None:
        self.cell = cell
        self.emulator = emulator
        self.evidence = evidence
        self.broken: str | None = None
        self.trail: deque[str] = deque(maxlen=TRAIL)
        self.backs: list[float] = []
        """How long each start took to its first answer."""
        self.steps = 0
        self.done: Counter[str] = Counter()
        self.outcomes: Counter[str] = Counter()
        self.causes: Counter[str] = Counter()
        self.kills: list[float] = []
        self.judged: set[Path] = set()
        self.slowest = 0.0
        self.judged_at = 0.0
        self.never = ""

    def tip(self) -> dict[str, Any]:
        """Return where the arm truly stands, for referencing it."""
        return dict(self.emulator.truth()["tip"]) if self.emulator is not None else dict(HOME)

    def say(self, text: str) -> None:
        """Take down one thing that was done, or answered."""
        self.trail.append(f"{time.monotonic():.3f} {self.steps} {text}")

    def broke_off(self, error: Exception) -> None:
        """Keep what the first violation was, and all that shows how it came about."""
        if self.broken is not None:
            return
        self.broken = "".join(traceback.format_exception(error))
        if self.evidence is None:
            return
        folder, cell = self.evidence, self.cell
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        code = cell.process.poll()
        ended = f"the daemon has ended with {code}" if code is not None else "the daemon runs"
        (folder / "violation.txt").write_text(f"{self.broken}\n{ended}\n")
        (folder / "steps.txt").write_text("\n".join(self.trail) + "\n")
        (folder / "daemon.log").write_bytes(cell.log.read_bytes()[-KEPT_BYTES:])
        (folder / "cell.toml").write_bytes(cell.config.read_bytes())
        if self.emulator is not None:
            line = (self.emulator.folder / "line.txt").read_bytes()
            (folder / "line.txt").write_bytes(line[-KEPT_BYTES:])
        for path in judge.folders(cell.state_dir)[-KEPT_SESSIONS:]:
            shutil.copytree(path, folder / "sessions" / path.name, symlinks=True)

    def fresh(self) -> list[Path]:
        """Return the sessions that have not been judged, and take them for judged."""
        found = [p for p in judge.folders(self.cell.state_dir) if p not in self.judged]
        self.judged |= set(found)
        return found


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    """Draw a number with few digits."""
    return st.integers(int(low * 100), int(high * 100)).map(lambda n: n / 100)


class Client(RuleBasedStateMachine):
    """What may be done; `ward` is set by whoever runs it."""

    ward: ClassVar[Ward]

    came = False

    @initialize()
    def comes(self) -> None:
        """Connect to a daemon that is idle, and begin to count."""
        self.cell = self.ward.cell
        self.line, self.stops = Line(self.cell.lines["requests"]), Line(self.cell.lines["stop"])
        self.accepted: list[str] = []
        self.lease: str | None = None
        self.fault: dict[str, Any] | None = None
        self.loose = self.repeating = False
        self.came = True
        brought_to_idle(self.line)

    # What a client does.

    @rule(job=st.sampled_from(("massage", "massage", "run")), seconds=numbers(0, 3))
    def awaits_its_job(self, job: str, seconds: float) -> None:
        """Have a job run undisturbed, to its end as a rule."""
        self._did(f"{job}, awaited")
        self._make_ready()
        answer = self._ask(job)
        if "result" in answer:
            self.accepted.append(str(answer["result"]["session"]))
            self._ask("wait", session=self.accepted[-1], timeout_s=seconds)
            self._status()

    @rule()
    def becomes_ready(self) -> None:
        """Bring the cell to where a massage can begin."""
        self._did("ready")
        self._make_ready()

    @rule(job=st.sampled_from(("massage", "run", "massage", "home", *JOBS)), keyed=st.booleans())
    def begins(self, job: str, keyed: bool) -> None:
        """Ask for a job, mostly when it can begin; with a key ask twice, and see that it is one."""
        self._did(job)
        if not self._one_in(4):
            self._make_ready()
        key = {"key": f"k{self.ward.steps}"} if keyed else {}
        answer = self._ask(job, **key, **self._token())
        if "result" in answer:
            session = str(answer["result"]["session"])
            assert session not in self.accepted, "one session was begun twice"
            self.accepted.append(session)
            if keyed:
                assert self._ask(job, **key)["result"]["session"] == session

    @rule(
        method=st.sampled_from(("pause", "resume", "stop", "pause", "resume")),
        after=numbers(0, 0.15),
    )
    def interferes(self, method: str, after: float) -> None:
        """Ask the running job for something at any moment."""
        self._did(method)
        time.sleep(after)
        self._ask(method, **({} if method == "stop" else self._token()))

    @rule(method=st.sampled_from(("stop", "ping", "estop")), after=numbers(0, 0.15),
          patience=st.sampled_from((0.3, 0.0, 1.0)))  # fmt: skip
    def pulls_the_line(self, method: str, after: float, patience: float) -> None:
        """Stop on the line that is for it; from the answer on nothing moves."""
        self._did(f"line {method}")
        time.sleep(after)
        params = {} if method == "ping" else {"timeout_s": patience}
        told = self.stops.ask(method, **params)["result"]
        if method != "ping":
            assert told["received"] <= told["commanded"]
            assert told["confirmed"] is None or told["confirmed"] >= told["received"]
            self._status()

    @rule()
    def estops(self) -> None:
        """Send an emergency stop the ordinary way, now and then."""
        self._did("estop" if (now := self._one_in(4)) else "status")
        if not now:
            self._status()
            return
        assert self._ask("estop")["result"]["state"] == "fault"
        assert self._status()["fault"]["cause"]

    @rule(answered=st.booleans())
    def resets(self, answered: bool) -> None:
        """Leave fault, or try to."""
        self._did("reset")
        self.fault = None
        if answered:
            self._ask("reset", **self._token())
        else:
            self.line.send("reset", **self._token())

    @rule(true=st.booleans())
    def references(self, true: bool) -> None:
        """Say where the arm stands, or where no arm can."""
        self._did("reference")
        where = self.ward.tip() if true else {"xyz_mm": [9000.0, 0.0, 0.0]}
        self._ask("reference", **where, **self._token())

    @rule(duration=st.sampled_from((0.0, 0.3, 0.5, 2.0)), deadman=st.booleans())
    def leases(self, duration: float, deadman: bool) -> None:
        """Take a lease, renew it, or give it back."""
        self._did("lease")
        answer = self._ask("lease", duration_s=duration, deadman=deadman, **self._token())
        self.lease = answer.get("result", {}).get("lease")

    @rule(job=st.sampled_from(("home", *JOBS)), count=st.integers(1, 3), resets=st.integers(0, 3),
          every=st.sampled_from((0.0, 20.0)))  # fmt: skip
    def campaigns(self, job: str, count: int, resets: int, every: float) -> None:
        """Have a job repeated."""
        self._did("campaign")
        self._ask(
            "campaign", job=job, count=count, every_s=every, resets=resets, **self._token()
        )  # fmt: skip

    @rule(method=st.sampled_from(("end_campaign", "campaigns")))
    def sees_to_campaigns(self, method: str) -> None:
        """End what is repeated, or list it."""
        self._did(method)
        self._ask(method, **(self._token() if method == "end_campaign" else {}))

    @rule(method=st.sampled_from(("ping", "describe", "sessions", "status")))
    def reads(self, method: str) -> None:
        """Look, which is never refused."""
        self._did(method)
        assert "result" in self._ask(method)

    @rule(which=st.integers(0, 1000), method=st.sampled_from(("session", "wait")))
    def asks_after_sessions(self, which: int, method: str) -> None:
        """Ask after a session that there is, or after none."""
        self._did(method)
        # What there is depends on the daemon: hypothesis must not draw from it.
        names = [*self.accepted, "nothing", "../.."]
        known = names[which % len(names)]
        params = {"timeout_s": 0.05} if method == "wait" else {}
        answer = self._ask(method, session=known, **params)
        assert ("result" in answer) == (known in self.accepted), answer

    @rule(seq=st.integers(0, 400))
    def replays(self, seq: int) -> None:
        """Ask for events that were missed: their numbers have no gaps."""
        self._did("events_since")
        boot = self._ask("ping")["result"]["boot"]
        told = self._ask("events_since", boot=boot, seq=seq, limit=50)["result"]
        got = [event["seq"] for event in told["events"]]
        assert got == list(range(got[0], got[0] + len(got))) if got else True

    @rule(seed=st.integers(0, 2**32), where=st.sampled_from(("requests", "stop", "events")))
    def talks_nonsense(self, seed: int, where: str) -> None:
        """Send junk to any socket."""
        self._did("junk")
        rng = np.random.default_rng(seed)
        context = zmq.Context()
        kind = zmq.XSUB if where == "events" else zmq.DEALER
        socket = context.socket(kind)
        socket.linger = 50
        socket.connect(self.cell.lines[where])
        for _ in range(3):
            frames = [junk.wish(rng)] if where == "events" else junk.message(rng)
            socket.send_multipart(frames)
        socket.close()
        context.term()

    @rule(method=st.sampled_from(junk.HARMLESS), seed=st.integers(0, 2**32))
    def asks_wrongly(self, method: str, seed: int) -> None:
        """Send a method that there is with parameters that it does not have."""
        self._did("wrong")
        answer = self._ask(method, **junk.wrong_params(np.random.default_rng(seed)))
        assert answer["error"]["code"] == -32602, answer

    @rule(job=st.sampled_from(("massage", "run", "lease", "reset")))
    def vanishes(self, job: str) -> None:
        """Ask for something and be gone before the answer."""
        self._did("vanish")
        gone = Line(self.cell.lines["requests"])
        params = {"duration_s": 0.3, "deadman": True} if job == "lease" else {}
        self.loose = self.loose or job == "reset"
        gone.send(job, **params)
        gone.socket.close(linger=100)
        gone.context.term()
        time.sleep(0.02)

    @rule(seconds=numbers(0, 0.3))
    def waits(self, seconds: float) -> None:
        """Let time pass."""
        self._did("time")
        time.sleep(seconds)
        self._status()

    @rule(seconds=numbers(0.05, 0.4))
    def freezes(self, seconds: float) -> None:
        """Freeze the process for a moment, now and then."""
        self._did("freeze" if (now := self._one_in(5)) else "status")
        if now:
            self.cell.send_signal(signal.SIGSTOP)
            time.sleep(seconds)
            self.cell.send_signal(signal.SIGCONT)
        self._status()

    @rule(how=st.sampled_from(("kill", "terminate", "shutdown")))
    def ends_it(self, how: str) -> None:
        """End the process and start it again: nothing moves by itself, nothing is forgotten."""
        self._did(how if (now := self._one_in(8)) else "status")
        if not now:
            self._status()
            return
        running = self._running()
        if how == "kill":
            self.ward.kills.append(self.cell.kill())
        else:
            told = self._ask("shutdown", **self._token()) if how == "shutdown" else {}
            if "result" not in told:  # another may have the lease
                self.cell.process.terminate()
            self.cell.process.wait(40.0)
            assert self.cell.process.returncode == 0, how
            self.ward.kills.append(time.monotonic())
        assert self.cell.orphans() == []
        self.cell.begin()
        for line in (self.line, self.stops):
            line.again()
        self.lease, self.fault, self.loose = None, None, False
        status = self._status(back=True)
        if how == "kill" and running is not None and self._told(running) == "interrupted":
            assert status["fault"]["cause"] == "interrupted", status
        self.fault = status["fault"]

    # What always holds.

    def teardown(self) -> None:
        """End the example; what breaks off is kept as it was, before hypothesis tries it again."""
        if not self.came:
            return
        broken = sys.exc_info()[1]  # what a rule has raised
        try:
            if isinstance(broken, Exception):
                self.ward.broke_off(broken)
            else:
                self._ends()
        except Exception as error:
            self.ward.broke_off(error)
            raise
        finally:
            self.ward.slowest = max(self.ward.slowest, self.line.slowest[1])
            self.line.close()
            self.stops.close()

    def _ends(self) -> None:
        """See that all is answered, all has ended, and what is on the disk is sound."""
        owed = self.line.drain(25.0)
        assert not owed, f"never answered: {owed}"
        assert not self.line.unknown, self.line.unknown[:3]
        time.sleep(0.35)  # a lease that is held ends by itself, or is longer and its token known
        if self.lease is not None:
            self._ask("lease", duration_s=0.0, lease=self.lease)
        self._ask("end_campaign")
        self._ask("stop")
        self.fault = None
        for session in self.accepted:
            self.ward.outcomes[self.line.outcome(session)] += 1
            self.ward.causes[str(self.line.do("session", session=session)["cause"])] += 1
        status = brought_to_idle(self.line)
        assert status["fault"] is None
        self._judge()

    def _judge(self) -> None:
        """Hold what the example has left to the invariants."""
        fresh = self.ward.fresh()
        wrong = list(judge.records(fresh))
        if self.ward.emulator is not None:
            motions = [t for t, _ in self.ward.emulator.motions() if t > self.ward.judged_at]
            wrong += judge.on_the_line(motions, fresh, self.ward.kills)
            self.ward.judged_at = max(motions, default=self.ward.judged_at)
        lines = self.cell.logged(since=self.cell.mark)
        wrong += judge.chained((x for x in lines if x["event"] == "state"), STATIONS)
        wrong += [str(line) for line in lines if line["event"] in BUGS] + self.cell.said()
        assert not wrong, "\n".join(wrong[:5])

    def _make_ready(self) -> None:
        """Reset, reference and find the leg, as far as they are wanting."""
        if self.lease is not None:
            self._ask("lease", duration_s=0.0, lease=self.lease)
        self.lease, self.fault = None, None
        try:
            ready_to_massage(self.line, self.ward.tip)
        except AssertionError as error:
            self.ward.done["never ready"] += 1
            self.ward.never = str(error)

    def _one_in(self, count: int) -> bool:
        """Say yes once in so many steps; hypothesis would draw the extremes too often."""
        return bool(np.random.default_rng(self.ward.steps).integers(count) == 0)

    def _did(self, what: str) -> None:
        self.ward.steps += 1
        self.ward.done[what] += 1
        self.ward.say(what)

    def _token(self) -> dict[str, Any]:
        return {"lease": self.lease} if self.lease is not None else {}

    def _ask(self, method: str, **params: Any) -> dict[str, Any]:
        """Return the answer to a request, which is a result or a refusal that is documented."""
        number = self.line.send(method, **params)
        answer = self.cell.answer(self.line, number, 25.0)
        if "error" in answer:
            error = answer["error"]
            self.ward.say(f"{method} {params}: {error['message']}: {error['data']}")
            assert error["code"] in KNOWN, (method, params, error)
            assert error["data"]["reason"], (method, error)
            if error["message"] == "expired" and method != "lease":
                self.lease = None
        else:
            self.ward.say(f"{method} {params}: {str(answer['result'])[:300]}")
        return answer

    def _status(self, *, back: bool = False) -> dict[str, Any]:
        """Look, and see that a fault is latched until somebody resets."""
        if back:
            answer, took = self.cell.back(self.line)
            self.ward.backs.append(took)
        else:
            answer = self.cell.answer(self.line, self.line.send("status"), ANSWER_S)
        status: dict[str, Any] = answer["result"]
        fault = status["fault"]
        self.ward.say(f"status: {status['state']} {status['session']} {fault} {status['campaign']}")
        assert (fault is not None) == (status["state"] == "fault"), status
        repeating = bool((status["campaign"] or {}).get("underway"))
        owed = any(method == "reset" for method, _ in self.line.pending.values())
        if self.fault is not None and not (self.loose or self.repeating):
            assert fault == self.fault, f"{self.fault} was latched, now {fault}"
        # Who has been asked to reset may do so at any moment from now on.
        self.fault = None if owed or repeating else fault
        self.repeating = repeating
        return status

    def _running(self) -> str | None:
        status = self._status()
        return str(status["session"]) if status["state"] not in ("idle", "fault") else None

    def _told(self, session: str) -> str | None:
        outcome = self._ask("session", session=session)["result"]["outcome"]
        return str(outcome) if outcome is not None else None


def let_loose(ward: Ward, examples: int, steps: int, *, seed: int | None = None) -> None:
    """Have `examples` clients do `steps` things each; raises what the first violation raises.

    Without a `seed` they do the same each time.
    """

    class Loose(Client):
        pass

    Loose.ward = ward
    run_state_machine_as_test(
        Loose if seed is None else hypothesis_seed(seed)(Loose),
        settings=settings(
            max_examples=examples,
            stateful_step_count=steps,
            derandomize=seed is None,
            database=None,
            deadline=None,
            # What a daemon did once it need not do again: nothing is made smaller.
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        ),
    )
