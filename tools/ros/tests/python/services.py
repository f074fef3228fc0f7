import time
from dataclasses import dataclass
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, int64, uint8, uint64
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from crtk_arm import Arm, OperatingState, Topic, qos

@dataclass
class Request(IdlStruct, typename='crtk_msgs::srv::dds_::TriggerOperatingState_Request_'):
    guid: uint64
    sequence: int64
    structure_needs_at_least_one_member: uint8 = 0

@dataclass
class Response(IdlStruct, typename='crtk_msgs::srv::dds_::TriggerOperatingState_Response_'):
    guid: uint64
    sequence: int64
    operating_state: OperatingState

arm = Arm('i2ris')
arm.check_connections()
assert arm._wait(20.0, lambda: arm.states[-1].state == 'DISABLED'), arm.states
ask = DataWriter(arm.participant,
    Topic(arm.participant, 'rq/i2ris/operating_stateRequest', Request), qos())
answer = DataReader(arm.participant,
    Topic(arm.participant, 'rr/i2ris/operating_stateReply', Response), qos())
end, found = time.time() + 20, []
while time.time() < end and not found:
    ask.write(Request(guid=0x1234567890abcdef, sequence=7))
    time.sleep(0.3)
    found = [it for it in answer.take(10) if hasattr(it, 'guid')]
print(found[0].sequence, hex(found[0].guid), found[0].operating_state.state)
