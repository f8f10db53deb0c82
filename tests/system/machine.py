"""A client that does anything at any moment to a real daemon whose devices go wrong, and a judge.

Hypothesis draws what it does. What the daemon answers is held against what was ever promised; when
an example ends, everything it has left on the disk is judged.
"""

import signal
import time

import numpy as np
import zmq
from hypothesis import HealthCheck, Phase, settings
from hypothesis import seed as hypothesis_seed
from hypothesis import strategies as st
from hypothesis.stateful import (
    rule,
    run_state_machine_as_test,
)

from legato.control.table import JOBS
from tests.system import junk
from tests.system.judged import Judged
from tests.system.line import Line
from tests.system.ward import Ward


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    """Draw a number with few digits."""
    return st.integers(int(low * 100), int(high * 100)).map(lambda n: n / 100)


class Client(Judged):
    """What may be done, at any moment, in any order."""

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
