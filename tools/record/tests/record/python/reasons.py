import json, sys, time
from i2ris.arm import Arm, Fault, Refused
from i2ris.values import _sentence

with Arm(sys.argv[1]) as arm:
    end = time.monotonic() + 20.0
    while len(arm.warnings()) + len(arm.errors()) < int(sys.argv[2]) and time.monotonic() < end:
        time.sleep(0.005)
    for reason in arm.warnings() + arm.errors():
        line = f'{reason.text}; action: {reason.advice}'
        if reason.kind == 2:
            error = Refused('x', reason.code, measured=reason.measured)
            assert str(error) == 'the controller refuses x: ' + line, (str(error), line)
        if reason.kind == 1:
            error = Fault('', reason.code, reason.measured)
            assert str(error) == 'the robot is in FAULT: ' + line, (str(error), line)
        print(line)
