#!/usr/bin/env python3
"""A client of CRTK without ROS, on Cyclone DDS.

With the calls of CRTK's Python client, on the wheel `cyclonedds`:

    pip install cyclonedds
    i2ris start ros &
    python3 crtk_arm.py i2ris

homes and enables the arm, moves it, lets it follow a circle, and holds. Types and quality of
service are those of `crtk_python_client` 1.4; what rmw and rclpy would do is done by hand here.
"""

import math
import os
import sys
import threading
import time
from dataclasses import dataclass, field

from cyclonedds.core import DDSStatus, Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int32, sequence, uint8, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.internal import InvalidSample
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

DEPTH = 10

# This computer only, also without a network. rmw_cyclonedds names no interface with
# ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST: it takes the one of the network.
LOCALHOST = """
<CycloneDDS><Domain>
  <General>
    <Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces>
    <AllowMulticast>false</AllowMulticast>
  </General>
  <Discovery>
    <ParticipantIndex>auto</ParticipantIndex>
    <MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
    <Peers><Peer address="localhost"/></Peers>
  </Discovery>
</Domain></CycloneDDS>
"""


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32 = 0
    nanosec: uint32 = 0

    def seconds(self) -> float:
        return self.sec + self.nanosec * 1e-9


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@dataclass
class String(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    data: str = ""


@dataclass
class Empty(IdlStruct, typename="std_msgs::msg::dds_::Empty_"):
    structure_needs_at_least_one_member: uint8 = 0


@dataclass
class JointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    header: Header = field(default_factory=Header)
    name: sequence[str] = field(default_factory=list)
    position: sequence[float64] = field(default_factory=list)
    velocity: sequence[float64] = field(default_factory=list)
    effort: sequence[float64] = field(default_factory=list)


@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 0.0


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Point = field(default_factory=Point)
    orientation: Quaternion = field(default_factory=Quaternion)


@dataclass
class PoseStamped(IdlStruct, typename="geometry_msgs::msg::dds_::PoseStamped_"):
    header: Header = field(default_factory=Header)
    pose: Pose = field(default_factory=Pose)


@dataclass
class Transform(IdlStruct, typename="geometry_msgs::msg::dds_::Transform_"):
    translation: Vector3 = field(default_factory=Vector3)
    rotation: Quaternion = field(default_factory=Quaternion)


@dataclass
class TransformStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TransformStamped_"):
    header: Header = field(default_factory=Header)
    child_frame_id: str = ""
    transform: Transform = field(default_factory=Transform)


@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs::msg::dds_::TFMessage_"):
    transforms: sequence[TransformStamped] = field(default_factory=list)


@dataclass
class Twist(IdlStruct, typename="geometry_msgs::msg::dds_::Twist_"):
    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)


@dataclass
class TwistStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TwistStamped_"):
    header: Header = field(default_factory=Header)
    twist: Twist = field(default_factory=Twist)


@dataclass
class MultiArrayDimension(IdlStruct, typename="std_msgs::msg::dds_::MultiArrayDimension_"):
    label: str = ""
    size: uint32 = 0
    stride: uint32 = 0


@dataclass
class MultiArrayLayout(IdlStruct, typename="std_msgs::msg::dds_::MultiArrayLayout_"):
    dim: sequence[MultiArrayDimension] = field(default_factory=list)
    data_offset: uint32 = 0


@dataclass
class Float64MultiArray(IdlStruct, typename="std_msgs::msg::dds_::Float64MultiArray_"):
    layout: MultiArrayLayout = field(default_factory=MultiArrayLayout)
    data: sequence[float64] = field(default_factory=list)


@dataclass
class OperatingState(IdlStruct, typename="crtk_msgs::msg::dds_::OperatingState_"):
    header: Header = field(default_factory=Header)
    state: str = "UNDEFINED"
    is_homed: bool = False
    is_busy: bool = False


@dataclass
class StringStamped(IdlStruct, typename="crtk_msgs::msg::dds_::StringStamped_"):
    header: Header = field(default_factory=Header)
    string: str = ""


def qos(latched: bool = False, reliable: bool = True, depth: int = DEPTH) -> Qos:
    """Quality of service as CRTK's client has it."""
    return Qos(
        Policy.Reliability.Reliable(duration(seconds=1))
        if reliable
        else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        # As rmw writes messages: plain CDR of the first version.
        Policy.DataRepresentation(use_cdrv0_representation=True),
    )


_domains: dict[int, Domain] = {}


def configure(domain: int) -> None:
    """Keeps a domain on this computer, once, unless the user has a configuration."""
    if "CYCLONEDDS_URI" not in os.environ and domain not in _domains:
        _domains[domain] = Domain(domain, LOCALHOST)


class MoveHandle:
    """What a motion returns."""

    def __init__(self, arm: "Arm") -> None:
        self._arm = arm
        self._start = time.time()

    def wait(self, is_busy: bool = False, timeout: float = 30.0) -> bool:
        """Waits until the arm is busy, or was busy and is not any more."""
        return self._arm.wait_for_busy(is_busy, self._start, timeout)


class Arm:
    """An arm of CRTK. CRTK's own client does not request latched states."""

    def __init__(self, name: str, domain: int | None = None, latched: bool = True) -> None:
        if domain is None:
            domain = int(os.environ.get("ROS_DOMAIN_ID", "0"))
        self.name = name
        configure(domain)
        self.participant = DomainParticipant(domain)
        self._lock = threading.Condition()
        self.states: list[OperatingState] = []
        self.lines: dict[str, list[str]] = {"error": [], "warning": [], "status": []}
        streams = {
            "measured_js": JointState,
            "setpoint_js": JointState,
            "goal_js": JointState,
            "measured_cp": PoseStamped,
            "setpoint_cp": PoseStamped,
            "measured_cv": TwistStamped,
            "jacobian": Float64MultiArray,
        }
        self._newest = {name: kind() for name, kind in streams.items()}
        self._readers = {
            **{name: self.reader(name, kind) for name, kind in streams.items()},
            "operating_state": self.reader("operating_state", OperatingState, latched),
        }
        for word in self.lines:
            self._readers[word] = self.reader(word, String, latched=True)
        self._servo = {
            word: self.writer(word, JointState)
            for word in ("servo_jp", "servo_jr", "move_jp", "move_jr")
        }
        self._state_command = self.writer("state_command", StringStamped, latched=True)
        self._hold = self.writer("hold", Empty)
        self._free = self.writer("free", Empty)
        self._ended = False
        self._thread = threading.Thread(target=self._receive, daemon=True)
        self._thread.start()

    def topic(self, name: str, kind: type) -> Topic:
        return Topic(self.participant, f"rt/{self.name}/{name}", kind)

    def reader(self, name: str, kind: type, latched: bool = False, **more) -> DataReader:
        return DataReader(self.participant, self.topic(name, kind), qos(latched, **more))

    def writer(self, name: str, kind: type, latched: bool = False, **more) -> DataWriter:
        return DataWriter(self.participant, self.topic(name, kind), qos(latched, **more))

    def close(self) -> None:
        self._ended = True
        self._thread.join()

    def _receive(self) -> None:
        while not self._ended:
            for name, reader in self._readers.items():
                for message in reader.take(100):
                    if not isinstance(message, InvalidSample):
                        self._note(name, message)
            time.sleep(0.001)

    def _note(self, name: str, message) -> None:
        with self._lock:
            if name == "operating_state":
                newest = self.states[-1].header.stamp.seconds() if self.states else 0.0
                # As CRTK's client: a state that is not newer is ignored.
                if message.header.stamp.seconds() > newest:
                    self.states.append(message)
            elif name in self._newest:
                self._newest[name] = message
            else:
                self.lines[name].append(message.data)
            self._lock.notify_all()

    def _wait(self, timeout: float, done) -> bool:
        with self._lock:
            return self._lock.wait_for(done, timeout)

    def check_connections(self, timeout: float = 10.0) -> None:
        """Waits until every command has a reader and the arm has sent a message."""

        def connected() -> bool:
            writers = [*self._servo.values(), self._state_command, self._hold, self._free]
            matched = all(writer.read_status(DDSStatus.PublicationMatched) for writer in writers)
            return matched and self.operating_state() != "UNDEFINED"

        end = time.time() + timeout
        while not connected():
            if time.time() > end:
                raise RuntimeError(f"no arm answers as /{self.name}")
            time.sleep(0.01)

    # Queries.

    def measured_jp(self) -> list[float]:
        return list(self._valid("measured_js").position)

    def setpoint_jp(self) -> list[float]:
        return list(self._valid("setpoint_js").position)

    def goal_jp(self) -> list[float]:
        return list(self._valid("goal_js").position)

    def measured_cp(self) -> PoseStamped:
        return self._valid("measured_cp")

    def setpoint_cp(self) -> PoseStamped:
        return self._valid("setpoint_cp")

    def measured_cv(self) -> TwistStamped:
        return self._valid("measured_cv")

    def jacobian(self) -> list[list[float]]:
        if not self._wait(5.0, lambda: self._newest["jacobian"].data):
            raise RuntimeWarning("no valid data for jacobian")
        message = self._newest["jacobian"]
        columns = message.layout.dim[1].size
        data = list(message.data)
        return [data[at : at + columns] for at in range(0, len(data), columns)]

    def _valid(self, name: str, timeout: float = 5.0):
        valid = lambda: self._newest[name].header.stamp.seconds() > 0.0
        if not self._wait(timeout, valid):
            raise RuntimeWarning(f"no valid data for {name}")
        return self._newest[name]

    def operating_state(self) -> str:
        with self._lock:
            return self.states[-1].state if self.states else "UNDEFINED"

    def is_homed(self) -> bool:
        with self._lock:
            return bool(self.states) and self.states[-1].is_homed

    # Commands.

    def state_command(self, word: str) -> None:
        # Without a stamp, as CRTK's client.
        self._state_command.write(StringStamped(string=word))

    def _change(self, word: str, timeout: float, reached) -> bool:
        self.state_command(word)
        return self._wait(timeout, lambda: reached(self.states[-1]))

    def enable(self, timeout: float = 30.0) -> bool:
        return self._change("enable", timeout, lambda it: it.state == "ENABLED" and not it.is_busy)

    def disable(self, timeout: float = 30.0) -> bool:
        return self._change("disable", timeout, lambda it: it.state == "DISABLED")

    def home(self, timeout: float = 30.0) -> bool:
        return self._change("home", timeout, lambda it: it.is_homed and not it.is_busy)

    def servo_jp(self, position: list[float]) -> None:
        self._servo["servo_jp"].write(JointState(position=list(position)))

    def servo_jr(self, position: list[float]) -> None:
        self._servo["servo_jr"].write(JointState(position=list(position)))

    def move_jp(self, position: list[float]) -> MoveHandle:
        handle = MoveHandle(self)
        self._servo["move_jp"].write(JointState(position=list(position)))
        return handle

    def move_jr(self, position: list[float]) -> MoveHandle:
        handle = MoveHandle(self)
        self._servo["move_jr"].write(JointState(position=list(position)))
        return handle

    def hold(self) -> None:
        self._hold.write(Empty())

    def free(self) -> None:
        self._free.write(Empty())

    def wait_for_busy(self, is_busy: bool, start: float, timeout: float) -> bool:
        def done() -> bool:
            after = [it.is_busy for it in self.states if it.header.stamp.seconds() > start]
            if is_busy:
                return True in after
            return True in after and not after[-1]

        return self._wait(timeout, done)


def example(name: str) -> None:
    """Homes, enables, moves, servoes and holds."""
    arm = Arm(name)
    arm.check_connections()
    print("state:", arm.operating_state())
    if not arm.is_homed() and not arm.home():
        sys.exit(f"cannot home: {arm.lines}")
    if not arm.enable():
        sys.exit(f"cannot enable: {arm.lines}")
    print("enabled at", [round(math.degrees(it), 2) for it in arm.measured_jp()], "deg")

    if not arm.move_jp([math.radians(5.0), 0.0]).wait():
        sys.exit(f"did not move: {arm.lines}")
    print("moved to", [round(math.degrees(it), 2) for it in arm.measured_jp()], "deg")

    period, rate = 4.0, 200.0
    start = time.time()
    while (elapsed := time.time() - start) < period:
        angle = 2.0 * math.pi * elapsed / period
        arm.servo_jp([math.radians(5.0 * math.cos(angle)), math.radians(5.0 * math.sin(angle))])
        time.sleep(1.0 / rate)
    arm.hold()

    if not arm.move_jp([0.0, 0.0]).wait():
        sys.exit(f"did not move back: {arm.lines}")
    tip = arm.measured_cp().pose.position
    print(f"the tip is at {tip.x * 1e3:.3f}, {tip.y * 1e3:.3f}, {tip.z * 1e3:.3f} mm")
    arm.disable()
    print("state:", arm.operating_state())
    arm.close()


if __name__ == "__main__":
    example(sys.argv[1] if len(sys.argv) > 1 else "i2ris")
