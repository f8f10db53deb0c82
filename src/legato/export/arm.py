"""The arm that a session was done with, by the configuration in its record."""

import msgspec

from legato.config.build import arm_model
from legato.config.schema import Config, RobotTable
from legato.geometry.arm import ArmModel
from legato.records.record import SessionRecord


def recorded_arm(record: SessionRecord) -> ArmModel:
    """Return the arm of a record's [robot]; the manual's where the record has none that reads."""
    table = (record.meta.get("config") or {}).get("robot")
    try:
        robot = msgspec.convert(table, RobotTable, strict=False)
    except msgspec.ValidationError:
        return ArmModel()
    return arm_model(Config(robot=robot))
