"""What a daemon has promised, held against what it does and leaves."""

import sys
import time
from typing import Any, ClassVar

import numpy as np
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
)

from tests.system import judge
from tests.system.line import Line, brought_to_idle, ready_to_massage
from tests.system.ward import Ward

STATIONS = (7.0, 67.0)
ANSWER_S = 5.0  # until status has to be answered, on a machine that is busy with something else
BUGS = ("bug", "worker_gone", "not_tidied")
KNOWN = {
    -32700, -32600, -32601, -32602, -32000, -32001, -32002, -32003, -32004, -32005, -32006,
}  # fmt: skip


class Judged(RuleBasedStateMachine):
    """A client whose daemon keeps its word; `ward` is set by whoever runs it."""

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
