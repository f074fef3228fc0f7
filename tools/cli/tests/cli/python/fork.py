# The children of a fork that end as Python does, without and with use of what they inherited.
import os, sys, time
from i2ris.arm import Arm

arm = Arm(sys.argv[1], deadline_s=0.5)
arm.state_command('home')
arm.enable().wait()
for uses in (False, True):
    accepted = arm.operating_state().accepted
    arm.servo_jp([0.0, 0.0])
    child = os.fork()
    if child == 0:
        if uses:
            assert arm.operating_state().state == 'ENABLED'
        sys.exit(0)
    assert os.waitpid(child, 0)[1] == 0
    time.sleep(0.1)
    first = arm.measured_js().stamp_ns
    arm.servo_jp([0.0, 0.0])
    state = arm.wait_for(lambda state: state.accepted >= accepted + 2)
    assert arm.measured_js().stamp_ns > first and state.lease, state
