import os, time
from i2ris.arm import Arm, Refused
from i2ris.payload import INTERFACE_VERSION

with Arm(deadline_s=0.5) as arm:
    assert arm.version().interface == INTERFACE_VERSION
    end = time.monotonic() + 20.0
    try:
        while time.monotonic() < end:
            arm.servo_jp([0.0, 0.0])
            time.sleep(0.005)
        raise AssertionError('refusals are lost')
    except Refused as refused:
        assert refused.code == 9 and 'position limits' in refused.reason, refused
