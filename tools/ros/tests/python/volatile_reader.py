import time
from crtk_arm import Arm
first = Arm('i2ris')
first.check_connections()
assert first.home() and first.enable(), first.lines
late = Arm('i2ris', latched=False)
assert late._wait(20.0, lambda: late.operating_state() == 'ENABLED'), late.states
start = time.time()
assert late.enable(5.0), late.lines
assert late._wait(5.0, lambda: late.states[-1].header.stamp.seconds() > start), late.states
assert late.move_jp([0.02, 0.0]).wait(), late.lines
rows = late.jacobian()
assert len(rows) == 6 and rows[1][0] > 1e-4 and rows[0][1] > 1e-4, rows
time.sleep(0.2)
assert abs(late.setpoint_cp().pose.position.y - 0.02 * rows[1][0]) < 1e-6, late.setpoint_cp()
assert abs(late.goal_jp()[0] - 0.02) < 1e-3, late.goal_jp()
assert abs(late.measured_cv().twist.linear.x) < 1.0, late.measured_cv()
late.free()
assert late._wait(10.0, lambda: late.operating_state() == 'DISABLED'), late.states
print('done')
