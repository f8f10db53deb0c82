"""The `[[sim.faults]]` list: what goes wrong with arm or camera, when, and for how long."""

from typing import Annotated, Final, Literal

from msgspec import Meta, Struct

Kind = Literal[
    "arm_lost", "arm_timeout", "arm_refused", "arm_stopped_by_pendant", "arm_blocks",
    "following_error", "lost_steps", "stuck_closed", "stuck_open", "early_contact",
    "camera_lost", "camera_stale", "blank", "dark", "slow_grab",
]  # fmt: skip
Call = Literal["open", "read", "step", "grab", "any"]

CAMERA_KINDS: Final = ("camera_lost", "camera_stale", "blank", "dark", "slow_grab")
STUCK: Final = ("stuck_closed", "stuck_open")
CALLS: Final = {"arm": ("open", "read", "step", "any"), "camera": ("open", "grab", "any")}
BY: Final = {
    "arm_timeout": 1.0,
    "arm_blocks": 2.0,
    "following_error": 60.0,
    "lost_steps": 60.0,
    "camera_stale": 5.0,
    "slow_grab": 2.0,
}
"""How much, where `by` says nothing: s, or half-steps for the two kinds that miss steps."""


class FaultSettings(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One fault. It begins at one of `at_s`, `call` and `p`; names are the configuration's keys."""

    kind: Kind
    at_s: Annotated[float, Meta(ge=0, le=10_000_000)] | None = None
    """The first call so many cell seconds after the start."""
    call: Annotated[int, Meta(ge=1, le=1_000_000_000)] | None = None
    """The n-th call."""
    p: Annotated[float, Meta(ge=0, le=1)] | None = None
    """Each call with this probability."""
    on: Call | None = None
    """Which calls count: `step` for an arm and `grab` for a camera unless told."""
    calls: Annotated[int, Meta(ge=1, le=1_000_000_000)] = 1
    """Strikes so many counted calls in a row."""
    for_s: Annotated[float, Meta(ge=0, le=10_000_000)] = 0.0
    """Strikes every call for so many cell seconds more; a device that is lost cannot be opened."""
    by: Annotated[float, Meta(gt=0, le=1_000_000)] | None = None
    motor: Annotated[int, Meta(ge=1, le=6)] = 2
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)] = 1
    """Of the draws for `p`."""

    @property
    def device(self) -> str:
        """Whose fault it is: `arm` or `camera`."""
        return "camera" if self.kind in CAMERA_KINDS else "arm"

    @property
    def counted(self) -> str:
        """Which calls count."""
        return self.on or ("grab" if self.device == "camera" else "step")

    @property
    def size(self) -> float:
        """How much: seconds or half-steps, as the kind has it."""
        return self.by if self.by is not None else BY.get(self.kind, 0.0)
