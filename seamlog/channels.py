"""The one table of topics: name, message, fields, units, nominal rate and meaning.

The writer, the reader and the documentation (`python -m seamlog.channels`) come from it.
Field types are those of ROS 2 messages; nested ones are written flat, which is the same in CDR.
Our own messages begin with `int64 stamp_ns`, the time
of the physical event (exposure, sample) in nanoseconds since 1970; log time is its arrival.
"""

import sys
from dataclasses import dataclass

IMAGE_SCHEMA = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO_SCHEMA = "sensor_msgs/msg/CameraInfo"


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a message; `type` is a ROS 2 type such as `float64` or `float64[8]`."""

    type: str
    name: str
    unit: str
    meaning: str


@dataclass(frozen=True, slots=True)
class Channel:
    """A topic, the message it carries and what it means."""

    topic: str
    schema: str
    fields: tuple[Field, ...]
    rate_hz: float | None
    meaning: str
    constants: tuple[tuple[str, str, int], ...] = ()

    @property
    def field_names(self) -> tuple[str, ...]:
        """Names in the order of the message, `stamp_ns` first for our own messages."""
        return tuple(field.name for field in self.fields)


STAMP = Field("int64", "stamp_ns", "ns", "time of the physical event")

ARC_ON, ARC_OFF, FAULT, EMERGENCY_STOP, TRIGGER, CLOCK_STEP, NOTE = 1, 2, 3, 4, 5, 6, 7
EVENT_KINDS = {
    "ARC_ON": ARC_ON,
    "ARC_OFF": ARC_OFF,
    "FAULT": FAULT,
    "EMERGENCY_STOP": EMERGENCY_STOP,
    "TRIGGER": TRIGGER,
    "CLOCK_STEP": CLOCK_STEP,
    "NOTE": NOTE,
}


def _own(
    topic: str,
    message: str,
    rate_hz: float | None,
    meaning: str,
    *fields: Field,
    constants: tuple[tuple[str, str, int], ...] = (),
) -> Channel:
    schema = f"seamlog_msgs/msg/{message}"
    return Channel(topic, schema, (STAMP, *fields), rate_hz, meaning, constants)


def _f8(name: str, unit: str, meaning: str) -> Field:
    return Field("float64", name, unit, meaning)


def _u8(name: str, meaning: str) -> Field:
    return Field("uint64", name, "1", meaning)


_HEADER = (
    Field("builtin_interfaces/Time", "stamp_ns", "ns", "time of the exposure"),
    Field("string", "frame_id", "", "camera frame"),
)

_TABLE = (
    Channel(
        "/camera/image",
        IMAGE_SCHEMA,
        (
            *_HEADER,
            Field("string", "format", "", "jpeg or png"),
            Field("uint8[]", "data", "", "encoded picture"),
        ),
        10.0,
        "picture of the seam in front of the torch",
    ),
    Channel(
        "/camera/stripe",
        IMAGE_SCHEMA,
        (
            *_HEADER,
            Field("string", "format", "", "jpeg or png"),
            Field("uint8[]", "data", "", "encoded picture"),
        ),
        10.0,
        "picture of a laser stripe across the bead",
    ),
    Channel(
        "/camera/info",
        CAMERA_INFO_SCHEMA,
        (
            *_HEADER,
            Field("uint32", "height", "px", "rows of the picture"),
            Field("uint32", "width", "px", "columns of the picture"),
            Field("string", "distortion_model", "", "plumb_bob or rational_polynomial"),
            Field("float64[]", "d", "", "distortion coefficients"),
            Field("float64[9]", "k", "px", "intrinsic matrix, row by row"),
            Field("float64[9]", "r", "", "rectification matrix"),
            Field("float64[12]", "p", "px", "projection matrix"),
            Field("uint32", "binning_x", "", "0 or 1: none"),
            Field("uint32", "binning_y", "", "0 or 1: none"),
            Field("uint32", "roi.x_offset", "px", "region of interest"),
            Field("uint32", "roi.y_offset", "px", "region of interest"),
            Field("uint32", "roi.height", "px", "0: whole picture"),
            Field("uint32", "roi.width", "px", "0: whole picture"),
            Field("bool", "roi.do_rectify", "", "region of the rectified picture"),
        ),
        None,
        "camera model: size, lens distortion, intrinsic matrix",
    ),
    _own(
        "/table/encoder",
        "Encoder",
        25.0,
        "measured motion of the table",
        _f8("position_m", "m", "table position across the seam, sign as the encoder"),
        _f8("velocity_m_s", "m/s", "table velocity"),
    ),
    _own(
        "/table/reference",
        "Reference",
        25.0,
        "motion asked of the table",
        _f8("position_m", "m", "reference position"),
        _f8("velocity_m_s", "m/s", "reference velocity"),
        _f8("acceleration_m_s2", "m/s^2", "reference acceleration"),
    ),
    _own(
        "/table/command",
        "Command",
        25.0,
        "what the live loop sent to the drive; unit in the channel metadata",
        _f8("command", "metadata", "command after saturation"),
        Field("bool", "saturated", "", "the drive's limit was reached"),
    ),
    _own(
        "/controller/state",
        "ControllerState",
        25.0,
        "inner values of the controller, named in the channel metadata `names`",
        Field("float64[8]", "values", "metadata", "up to eight values, the rest NaN"),
    ),
    _own(
        "/estimator/state",
        "EstimatorState",
        25.0,
        "parameters as the live estimator saw them",
        _f8("inertia", "unit s^2/m", "equivalent inertia a"),
        _f8("viscous_friction", "unit s/m", "viscous coefficient b"),
        _f8("coulomb_friction", "unit", "Coulomb coefficient C"),
        _f8("var_inertia", "(unit s^2/m)^2", "variance of a"),
        _f8("var_viscous_friction", "(unit s/m)^2", "variance of b"),
        _f8("var_coulomb_friction", "unit^2", "variance of C"),
        _f8("prediction_error", "unit", "predicted minus applied command"),
    ),
    _own(
        "/seam/points",
        "SeamPoints",
        10.0,
        "seam points found in the picture of the same stamp",
        Field("float64[]", "x_px", "px", "columns"),
        Field("float64[]", "y_px", "px", "rows"),
    ),
    _own(
        "/seam/path",
        "SeamPath",
        None,
        "seam path in the table frame, a polyline dense enough to be taken as the curve",
        Field("float64[]", "x_m", "m", "across the seam"),
        Field("float64[]", "y_m", "m", "along the robot's travel"),
    ),
    _own(
        "/seam/profile",
        "SeamProfile",
        10.0,
        "height profile across the seam, from a laser sensor",
        Field("float64[]", "x_m", "m", "across the seam"),
        Field("float64[]", "z_m", "m", "height, up"),
    ),
    _own(
        "/robot/marker",
        "RobotMarker",
        10.0,
        "marker on the torch found in the picture of the same stamp",
        _f8("x_px", "px", "column"),
        _f8("y_px", "px", "row"),
    ),
    _own(
        "/weld/process",
        "WeldProcess",
        25.0,
        "welding process values",
        _f8("current_a", "A", "welding current"),
        _f8("voltage_v", "V", "arc voltage"),
        _f8("wire_feedrate_m_min", "m/min", "wire feed rate"),
    ),
    _own(
        "/events",
        "Event",
        None,
        "what happened: arc on and off, faults, triggers, clock steps",
        Field("uint8", "kind", "", "one of the constants"),
        Field("string", "detail", "", "in words"),
        constants=tuple(("uint8", name, value) for name, value in EVENT_KINDS.items()),
    ),
    _own(
        "/seamlog/recorder",
        "RecorderStatus",
        1.0,
        "the recorder's own accounts, one message per channel",
        Field("string", "topic", "", "channel the counts are of"),
        _u8("offered", "accepted + dropped + refused"),
        _u8("accepted", "taken into the ring: written + lost + discarded + still in the ring"),
        _u8("dropped", "turned away because the ring was full"),
        _u8("refused", "turned away because the message was not valid"),
        _u8("written", "in the file"),
        _u8("lost", "accepted and not in the file"),
        Field("int64", "first_dropped_sequence", "1", "-1 if none"),
        Field("int64", "last_dropped_sequence", "1", "-1 if none"),
        _f8("ring_high_water", "1", "largest filled fraction of the ring so far"),
        Field("int64", "last_sync_ns", "ns", "log time of the last sync to disk, 0 if none"),
        _u8("free_bytes", "free space of the file system that holds the session"),
        _u8("discarded", "accepted and part of no snapshot; 0 but in snapshot mode"),
        _u8("durable", "written and synced to disk, as far as was known then"),
    ),
)

CHANNELS: dict[str, Channel] = {channel.topic: channel for channel in _TABLE}


def markdown_table() -> str:
    """The table as Markdown, for docs/channels.md."""
    lines = ["| topic | message | fields (unit) | rate Hz | meaning |", "|---|---|---|---|---|"]
    for channel in CHANNELS.values():
        fields = ", ".join(f"{f.name} ({f.unit})" if f.unit else f.name for f in channel.fields)
        rate = f"{channel.rate_hz:g}" if channel.rate_hz else ""
        row = (channel.topic, channel.schema, fields, rate, channel.meaning)
        lines.append("| " + " | ".join(row) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.stdout.write(markdown_table() + "\n")
