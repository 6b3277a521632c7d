"""Messages of varying length as others write them: joint states in CDR and in protobuf."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from seamlog.messages import CdrWriter

START_NS = 1_767_225_600_000_000_000
Values = np.ndarray[Any, Any]
JOINT_STATE = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
"""
JOINTS = ("axis_x", "table", "z", "torch_tilt")
QUANTITIES = {"cdr": ("position", "velocity", "effort")}
QUANTITIES["protobuf"] = ("position", "velocity", "acceleration", "effort")


def joint_values(count: int) -> Iterator[tuple[int, int, Values]]:
    """Time, how many joints, and their values (quantity by joint), message by message."""
    values = np.random.default_rng(2).normal(size=(count, 4, len(JOINTS)))
    for place in range(count):
        yield START_NS + place * 1_000_003, 1 + place % len(JOINTS), values[place]


def write_cdr(path: Path, count: int) -> None:
    """sensor_msgs/msg/JointState of ROS 2 by the mcap package."""
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = ("sensor_msgs/msg/JointState", "ros2msg", JOINT_STATE.encode())
        channel = writer.register_channel("/joints", "cdr", writer.register_schema(*schema))
        for time, joints, values in joint_values(count):
            message = CdrWriter()
            message.put("int32", time // 10**9)
            message.put("uint32", time % 10**9)
            message.put("string", "base")
            message.put("string[]", JOINTS[:joints])
            for row in values[:3]:
                message.put("float64[]", row[:joints].tolist())
            writer.add_message(channel, time, message.payload(), time)
        writer.finish()


def write_protobuf(path: Path, count: int) -> None:
    """foxglove.JointStates by foxglove-sdk."""
    import foxglove
    from foxglove.channels import JointStatesChannel
    from foxglove.messages import JointState, JointStates, Timestamp

    context = foxglove.Context()
    with foxglove.open_mcap(path, context=context):
        channel = JointStatesChannel("/joints", context=context)
        for time, joints, values in joint_values(count):
            rows = zip(JOINTS, values.T[:joints].tolist(), strict=False)
            states = [
                JointState(name=name, position=x, velocity=v, acceleration=a, effort=e)
                for name, (x, v, a, e) in rows
            ]
            stamp = Timestamp(sec=time // 10**9, nsec=time % 10**9)
            channel.log(JointStates(timestamp=stamp, joints=states), log_time=time)


def first_of_cdr(message: Any) -> tuple[Any, ...]:
    """The first joint."""
    return message.position[0], message.velocity[0], message.effort[0]


def all_of_cdr(message: Any) -> tuple[Any, ...]:
    """Every field, sequences as arrays as ours come."""
    numbers = (np.array(getattr(message, name)) for name in QUANTITIES["cdr"])
    stamp = message.header.stamp
    return stamp.sec, stamp.nanosec, message.header.frame_id, list(message.name), *numbers


def first_of_protobuf(message: Any) -> tuple[Any, ...]:
    """The first joint."""
    joint = message.joints[0]
    return joint.position, joint.velocity, joint.acceleration, joint.effort


def all_of_protobuf(message: Any) -> tuple[Any, ...]:
    """Every field, what repeats as arrays as ours come."""
    joints, stamp = message.joints, message.timestamp
    numbers = (
        np.array([getattr(joint, name) for joint in joints]) for name in QUANTITIES["protobuf"]
    )
    return stamp.seconds, stamp.nanos, [joint.name for joint in joints], *numbers


ALL_FIELDS = {
    "cdr": ["header.stamp.sec", "header.stamp.nanosec", "header.frame_id", "name"],
    "protobuf": ["timestamp.seconds", "timestamp.nanos", "joints.name"],
}
FIRST_JOINT = {"cdr": "{}[0]", "protobuf": "joints[0].{}"}
EVERY_JOINT = {"cdr": "{}", "protobuf": "joints.{}"}
