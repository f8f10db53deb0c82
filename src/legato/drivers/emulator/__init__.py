"""A TeachMover that is not there: its serial line, its timing and its faults, over any arm."""

from legato.drivers.emulator.controller import Emulator
from legato.drivers.emulator.faults import Fault, Faults, Kind, fault
from legato.drivers.emulator.terminal import PseudoTerminal

__all__ = ["Emulator", "Fault", "Faults", "Kind", "PseudoTerminal", "fault"]
