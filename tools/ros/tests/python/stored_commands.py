import sys, time
from crtk_arm import Arm
arm = Arm('i2ris')
arm.state_command('home')
arm.state_command('enable')
arm.move_jp([0.05, 0.0])
print('kept', flush=True)
# Until the robot is running, and some time more.
arm.check_connections(60.0)
time.sleep(4.0)
assert not any(it.is_homed or it.state == 'ENABLED' or it.is_busy for it in arm.states), arm.states
assert arm.home(), arm.lines
