"""The worker: one thread that owns the devices and performs one task after another.

Whatever happens in a task, the loop gets one message that ends it. Nothing here moves the arm but
a job's own effects.
"""

import ctypes
import gc
import platform
import sys
import threading
import traceback
from collections.abc import Callable, Generator, Sequence
from importlib import metadata
from typing import TYPE_CHECKING, Any

from legato import __version__
from legato.control.effects import CellFault, Effect, Refused, StopRequested
from legato.control.settings import CellSettings
from legato.control.tape import taped
from legato.daemon.cell import Cell
from legato.daemon.log import Log
from legato.daemon.messages import (
    DevicesKnown,
    FaultReport,
    JobEnded,
    Looked,
    Message,
    TaskEnded,
    WorkerGone,
)
from legato.daemon.orders import DoJob, DoReference, DoReset, Dropped, Orders, Quit
from legato.daemon.pulse import TASK_S, WAITING_S, Pulse
from legato.geometry.arm import Unreachable
from legato.geometry.motion import Steps
from legato.hal.faults import Cause, DeviceError
from legato.records.errors import RecordError

if TYPE_CHECKING:
    from legato.control.memory import Memory
    from legato.daemon.devices import Devices
    from legato.daemon.perform import Performer
    from legato.records.store import Summary

LOOK_S = 1.0  # between two looks at the idle arm
PICKING = ("run", "calibrate")  # jobs that find the leg anew
RETRIES = (2, 30)  # looks between two attempts to open what is missing, doubling

Procedures = Callable[[str, CellSettings, "Memory", float], Generator[Effect, Any, str]]


class Worker:
    """One thread over one cell.

    `last` is the reference and the registers recorded before; `tidy` removes old records, `recall`
    reads what the loop need not know before; `pulse` hears that the worker lives, `timed` how long
    each effect took.
    """

    def __init__(
        self,
        make_cell: Callable[[], Cell],
        settings: CellSettings,
        orders: Orders,
        post: Callable[[Message], None],
        log: Log,
        *,
        last: tuple[Steps | None, Steps | None] = (None, None),
        procedures: Procedures | None = None,
        tidy: Callable[[], object] = lambda: None,
        recall: "Callable[[], Sequence[Summary]]" = tuple,
        look_s: float = LOOK_S,
        pulse: Pulse | None = None,
        timed: Callable[[str, float], None] = lambda _, __: None,
    ) -> None:
        self._make_cell = make_cell
        self._settings = settings
        self._orders = orders
        self._post = post
        self._log = log
        self._last = last
        self._procedures = procedures
        self._tidy = tidy
        self._recall = recall
        self._look_s = look_s
        self._modules = 0
        self._pulse = pulse if pulse is not None else Pulse()
        self._timed = timed
        self._thread = threading.Thread(target=self._run, name="worker", daemon=True)

    def start(self) -> None:
        """Begin: open the devices, then wait for tasks."""
        self._thread.start()

    def join(self, timeout: float) -> bool:
        """Wait for the thread's end; say whether it has ended."""
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def _run(self) -> None:
        try:
            self._work()
        except BaseException:  # noqa: BLE001  # the loop must learn of the end, whatever it was
            self._post(WorkerGone(traceback.format_exc()))
        else:
            self._post(WorkerGone())

    def _work(self) -> None:
        # Vision and calibration load their libraries while the loop already answers.
        from legato.control.jobs import procedure
        from legato.control.memory import Memory
        from legato.daemon.devices import Devices

        self._procedures = self._procedures or procedure
        reference, registers = self._last
        devices = Devices(self._make_cell(), self._settings, Memory(reference, registers))
        try:
            for problem in devices.open():
                self._log.warning("missing", cause=problem.cause, text=problem.text)
            self._tidy_up()
            self._post(DevicesKnown(devices.view(), _versions(), self._recall()))
            self._let_be()
            while self._serve(devices):
                pass
        finally:
            devices.close()

    def _serve(self, devices: "Devices") -> bool:
        """Perform the next task, or look at the devices where there is none; False to end."""
        wait, looks = RETRIES[0], 0
        while True:
            self._pulse.promise("waiting", self._look_s + WAITING_S)
            task = self._orders.next_task(self._look_s)
            self._pulse.promise("looking" if task is None else type(task).__name__, TASK_S)
            match task:
                case DoJob():
                    self._job(task, devices)
                    return True
                case DoReference(token, pose):
                    self._task(token, devices, lambda: devices.reference(pose))
                    return True
                case DoReset(token):
                    self._task(token, devices, devices.reopen)
                    return True
                case Quit():
                    return False
                case None:
                    looks += 1
                    again = not devices.complete and looks >= wait
                    self._look(devices, again)
                    if again:
                        wait, looks = min(2 * wait, RETRIES[1]), 0

    def _look(self, devices: "Devices", open_missing: bool) -> None:
        try:
            if open_missing:
                devices.open()
            devices.look()
        except Exception:  # noqa: BLE001  # looking at a device must never end the worker
            self._log.error("bug", traceback=traceback.format_exc())
        self._tidy_up()
        self._post(Looked(devices.view()))

    def _tidy_up(self) -> None:
        """Remove old records where that is due."""
        try:
            self._tidy()
        except RecordError as error:
            self._log.warning("not_tidied", text=error.text, hint=error.hint)

    def _task(self, token: int, devices: "Devices", do: Callable[[], None]) -> None:
        problem: tuple[str, str] | None = None
        try:
            do()
        except DeviceError as error:
            problem = error.text, error.hint
        except Unreachable as error:
            problem = f"the arm cannot stand there: {error}", "give the pose that it stands at"
        except Exception as error:  # noqa: BLE001  # a bug ends the task, not the worker
            self._log.error("bug", traceback=traceback.format_exc())
            problem = f"{type(error).__name__}: {error}", "report it with the daemon's log"
        self._post(TaskEnded(token, devices.view(), problem))

    def _job(self, task: DoJob, devices: "Devices") -> None:
        from legato.daemon.perform import Performer

        performer = Performer(devices, self._settings, task.writer, self._orders, self._post)
        began = devices.cell.clock.monotonic()
        outcome, reason, cause, fault = self._outcome(task, devices, performer)
        try:
            if devices.cell.witness is not None:
                truth = truth_since(devices.cell.witness.testimony(), began)
                task.writer.document("truth", truth)
        except RecordError as error:
            if outcome not in (None, "fault"):
                fault = FaultReport(Cause.DISK, error.text, error.hint)
                outcome, reason, cause = "fault", fault.text, fault.cause
        self._tidy_up()
        self._post(JobEnded(task.session, outcome, reason, cause, fault, devices.view()))
        _give_back()
        self._let_be()

    def _let_be(self) -> None:
        """Take what has been loaded out of the collector's sight.

        Python stops every thread, the stop line's too, while it looks through all there is: 40 ms.
        """
        if len(sys.modules) != self._modules:
            self._modules = len(sys.modules)
            gc.freeze()

    def _outcome(
        self, task: DoJob, devices: "Devices", performer: "Performer"
    ) -> tuple[str | None, str | None, Cause | None, FaultReport | None]:
        """Run a job's procedure; return outcome, reason, cause and fault, whatever it meets."""
        from legato.daemon.perform import carry_out
        from legato.daemon.tape import JobTape, write_start

        assert self._procedures is not None
        if task.job in PICKING:
            devices.memory.picks = task.params.get("picks")
        try:
            now = devices.cell.clock.monotonic()
            write_start(task.writer, task.job, devices, now)
            work = self._procedures(task.job, self._settings, devices.memory, now)
            work = taped(work, JobTape(task.writer, self._pulse, self._timed))
            return carry_out(work, performer.perform, self._orders), None, None, None
        except Dropped:
            return None, None, None, None
        except StopRequested:
            return "stopped", None, None, None
        except Refused as refused:
            return "refused", str(refused), refused.cause, None
        except CellFault as error:
            fault = FaultReport(error.cause, error.text, error.hint, error.evidence)
        except DeviceError as error:
            fault = FaultReport(error.cause, error.text, error.hint)
        except RecordError as error:
            fault = FaultReport(Cause.DISK, error.text, error.hint)
        except Exception as error:  # noqa: BLE001  # a bug ends in one outcome too
            told = traceback.format_exc()
            self._log.error("bug", session=task.session, traceback=told)
            text = f"{type(error).__name__}: {error}"
            hint = "report it with the record of this session"
            fault = FaultReport(Cause.INTERNAL, text, hint, {"traceback": told})
        evidence = self._orders.trail.evidence() | dict(fault.evidence)
        fault = FaultReport(fault.cause, fault.text, fault.hint, evidence)
        return "fault", fault.text, fault.cause, fault


def _give_back() -> None:
    """Give the memory that a job has freed back to the system, where the C library can."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def truth_since(testimony: dict[str, object], began: float) -> dict[str, object]:
    """Return a testimony with only those touches and breaches that are later than `began`.

    `began` is the cell's clock in s.
    """
    times = {"touches": "began_s", "breaches": "t_s"}
    found = dict(testimony)
    for name, time_of in times.items():
        kept = found.get(name)
        if isinstance(kept, list):
            found[name] = [entry for entry in kept if entry.get(time_of, began) >= began]
    return found


def _versions() -> dict[str, str]:
    """Return the versions that a record names."""
    return {
        "legato": __version__,
        "python": platform.python_version(),
        "numpy": metadata.version("numpy"),
        "opencv": metadata.version("opencv-python-headless"),
    }
