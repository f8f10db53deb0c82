"""A daemon under test with what goes wrong on its devices, and what is kept of a violation."""

import shutil
import time
import traceback
from collections import Counter, deque
from pathlib import Path
from typing import Any

from tests.system import judge
from tests.system.attacked import Attacked
from tests.system.emulated import HOME, Cell

TRAIL, KEPT_BYTES, KEPT_SESSIONS = 2000, 2_000_000, 8  # of what a violation leaves
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
