"""Carries out effects: the only place where a decision becomes a motion, a picture or a line.

Every effect raises what it meets; the procedure is told, and the worker makes it an outcome.
"""

import time
from collections.abc import Callable, Generator
from dataclasses import replace
from typing import Any, assert_never

import numpy as np

from legato.control import envelope
from legato.control.document import residuals_told
from legato.control.effects import (
    CellFault,
    Dwell,
    Effect,
    Enter,
    Find,
    Grab,
    Hold,
    Move,
    ReadArm,
    Record,
    Save,
    Solve,
    Why,
)
from legato.control.jobs import CALIBRATION_FILE
from legato.control.perceive import Calibration, find_marks_in, perceive
from legato.control.settings import CellSettings
from legato.daemon.devices import Devices
from legato.daemon.messages import Happened, Message, Moved, StateWanted
from legato.daemon.orders import Dropped, Orders
from legato.daemon.patience import Patience
from legato.geometry.arm import forward, joints_from_steps
from legato.hal.arm import ArmReading
from legato.hal.camera import Frame
from legato.hal.faults import Cause, DeviceError
from legato.records.errors import RecordError
from legato.records.session import SessionWriter
from legato.records.trajectory import trajectory_row
from legato.vision.marks import Picking
from legato.vision.picture import encode_png

NAP_S = 0.1  # cell seconds between two looks at the interrupts while dwelling
TELEMETRY_S = 0.05  # wall seconds between two looks that a running job gives of the arm


def carry_out(
    work: Generator[Effect, Any, str], perform: Callable[[Effect], Any], orders: Orders
) -> str:
    """Drive a procedure to its end and return its outcome; raises what it raises, and Dropped."""
    try:
        effect = next(work)
        while True:
            try:
                orders.look()
                result = perform(effect)
            except Dropped:
                raise
            except Exception as error:  # noqa: BLE001  # whatever it is, the procedure is told
                effect = work.throw(error)
            else:
                effect = work.send(result)
    except StopIteration as end:
        return str(end.value)
    finally:
        work.close()


class Performer:
    """Performs the effects of one session; `post` tells the loop."""

    def __init__(
        self,
        devices: Devices,
        settings: CellSettings,
        writer: SessionWriter,
        orders: Orders,
        post: Callable[[Message], None],
        wall: Callable[[], float] = time.monotonic,
    ) -> None:
        self._devices = devices
        # A search that lasts long ends at a stop too.
        self._settings = replace(settings, engine=replace(settings.engine, heed=orders.look))
        self._writer = writer
        self._orders = orders
        self._post = post
        self._wall = wall
        self._told_at = -TELEMETRY_S
        self._station: float | None = None
        self._written = False  # a row of the trajectory
        orders.trail.begin(devices.cell.arm)
        if devices.memory.calibration is not None:
            self._note_residuals(devices.memory.calibration)

    def perform(self, effect: Effect) -> Any:
        """Carry out one effect and return its result."""
        self._orders.trail.add(_told(effect))
        match effect:
            case Enter(state):
                return self._enter(state)
            case Grab(name):
                return self._grab(name)
            case Find():
                return self._find(effect)
            case Solve():
                return self._solve(effect)
            case Move():
                return self._move(effect)
            case ReadArm():
                return self._read()
            case Dwell(seconds):
                return self._dwell(seconds)
            case Record(kind, data):
                self._post(Happened(self._writer.id, kind, dict(data)))
            case Save(name, document):
                self._save(name, dict(document))
            case Hold():
                self._tell(at_once=True)
                self._orders.hold()
            case _:
                assert_never(effect)
        return None

    def _enter(self, state: str) -> None:
        # Who hears of the new state and asks is told of the arm as it now stands.
        self._tell(at_once=True)
        self._post(StateWanted(self._writer.id, state))
        if not self._orders.entered():
            self._orders.look()
            raise RuntimeError(f"the procedure wanted to enter {state}, which the table forbids")

    def _grab(self, name: str) -> Frame:
        """Take a picture; a camera whose trouble may pass is opened anew and asked again."""
        clock = self._devices.cell.clock
        patience = Patience(clock.monotonic(), self._wall())
        while True:
            try:
                frame = self._devices.grab()
                break
            except DeviceError as error:
                pause = patience.pause(error, clock.monotonic(), self._wall())
                self._post(Happened(self._writer.id, "progress", patience.told(error, pause)))
            self._dwell(pause)
        self._orders.trail.note(picture=self._writer.frame(name, encode_png(frame.image)))
        return frame

    def _find(self, find: Find) -> Picking:
        seed = self._settings.calibration.seed
        return find_marks_in(find.frame.image, self._settings, seed=seed, picks=find.picks)

    def _solve(self, solve: Solve) -> Calibration:
        # Who asks meanwhile is told that the earlier calibration counts no more.
        self._tell(at_once=True)
        began, frame, seed = self._wall(), solve.frame, self._settings.calibration.seed
        solved = perceive(
            frame.image, self._settings, seed=seed, picks=solve.picks, now_s=time.time()
        )
        self._devices.solved = frame, self._wall() - began
        self._devices.calibrated_at = self._devices.cell.clock.monotonic()
        self._devices.calibrated_in = self._writer.id
        self._note_residuals(solved)
        return solved

    def _note_residuals(self, solved: Calibration) -> None:
        residuals = residuals_told(solved, self._settings)
        self._orders.trail.note(residuals=residuals, rms_px=solved.solution.rms_px)

    def _move(self, move: Move) -> ArmReading:
        """Check, send, and compare what the arm says with what it was told."""
        memory = self._devices.memory
        if memory.reference is None or memory.steps() != move.start:
            text = f"a motion from {move.start} was not sent: the arm stands at {memory.steps()}"
            raise CellFault(Cause.LIMIT, text, "reference the arm, then try again")
        reference = memory.reference
        leg = memory.calibration.world_from_object if memory.calibration is not None else None
        envelope.check(self._settings, leg, move)
        with self._orders.motion():
            reading = self._devices.step(move.move)
        self._station = move.station
        try:
            self._row(reading, move.target, str(move.why), reference)
        except RecordError:
            # The way off the leg is not broken off for a disk that takes no more.
            if move.why is not Why.RETRACT:
                raise
        expected = tuple(t - r for t, r in zip(move.target, reference, strict=True))
        if reading.registers != expected:
            self._devices.doubt()
            raise CellFault(
                Cause.FOLLOWING_ERROR,
                f"the arm's registers read {reading.registers}, {expected} were commanded",
                "see what holds the arm, then reset and reference it",
                {"commanded": list(expected), "read": list(reading.registers)},
            )
        self._tell(why=str(move.why))
        return reading

    def _read(self) -> ArmReading:
        reference = self._devices.memory.reference
        reading = self._devices.read()
        if reference is not None and self._devices.memory.reference is None:
            raise CellFault(
                Cause.FOLLOWING_ERROR,
                f"the arm's registers have changed to {reading.registers} by themselves",
                "see who moved the arm, then reset and reference it",
                {"read": list(reading.registers)},
            )
        stands = self._devices.memory.steps()
        if reference is not None and stands is not None and not self._written:
            # Where the first motion starts from; later ones start where the one before ended.
            self._row(reading, stands, "", reference)
        return reading

    def _dwell(self, seconds: float) -> None:
        clock = self._devices.cell.clock
        until = clock.monotonic() + seconds
        while (left := until - clock.monotonic()) > 0:
            self._orders.look()
            clock.sleep(min(left, NAP_S))

    def _save(self, name: str, document: dict[str, Any]) -> None:
        if name == CALIBRATION_FILE and self._devices.solved is not None:
            frame, seconds = self._devices.solved
            # The picture may have been taken in an earlier session; each record stands alone.
            picture = self._writer.frame("capture", encode_png(frame.image))
            document |= {"picture": picture, "seconds": seconds}
        self._writer.document(name, document)

    def _row(
        self, reading: ArmReading, commanded: tuple[int, ...], why: str, reference: tuple[int, ...]
    ) -> None:
        arm = self._settings.arm
        read = [a + b for a, b in zip(reference, reading.registers, strict=True)]
        joints, _ = joints_from_steps(arm, np.array(read))
        xyz, _, _ = forward(arm, joints)
        row = trajectory_row(
            t=self._devices.cell.clock.monotonic(),
            commanded=commanded,
            read=read,
            joints=joints.tolist(),
            xyz=xyz.tolist(),
            contact=reading.contact,
            station=self._station,
            why=why,
        )
        self._writer.trajectory(row)
        self._written = True

    def _tell(self, *, at_once: bool = False, why: str | None = None) -> None:
        """Give the loop a look at the arm, but not more often than people can see."""
        now = self._wall()
        if now - self._told_at < TELEMETRY_S and not at_once:
            return
        # From when it was due, not from when it came: else motions' lengths would thin it out.
        self._told_at = max(self._told_at + TELEMETRY_S, now - TELEMETRY_S)
        view = self._devices.view()
        data = {"arm": dict(view.arm), "station_mm": self._station, "why": why}
        self._post(Moved(self._writer.id, view, data))


def _told(effect: Effect) -> str:
    """Return an effect as one short line of evidence; pictures and documents by name only."""
    match effect:
        case Save(name):
            return f"Save({name})"
        case Find() | Solve():
            return type(effect).__name__
        case Record(kind, data):
            return f"Record({kind}, {dict(data)})"[:200]
        case _:
            return str(effect)[:200]
