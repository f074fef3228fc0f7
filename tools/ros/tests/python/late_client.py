import time
from crtk_arm import Arm
first = Arm('i2ris')
first.check_connections()
assert first.home() and first.enable(), first.lines
late = Arm('i2ris')
assert late._wait(20.0, lambda: late.states and late.states[-1].state == 'ENABLED'), late.states
assert len(late.states) > 2, late.states
assert late._wait(20.0, lambda: 'the robot is ENABLED' in late.lines['status']), late.lines
stamps = [it.header.stamp.seconds() for it in late.states]
assert stamps == sorted(set(stamps)), stamps
print('done')
