import sys, time
from i2ris.arm import Arm, OutOfReach, Refused

arm = Arm(sys.argv[1], deadline_s=0.5)
assert arm.operating_state().state == 'ENABLED' and arm.measured_js().valid
assert arm.enable().wait().state == 'ENABLED'
assert 'ENABLED, homed, [0.0, 0.0] deg' in repr(arm), repr(arm)
assert arm.why().startswith(repr(arm)), arm.why()
assert arm.fixtures.list() == []
arm.fixtures.add_circle(0.2, 0.0, 0.1)
end = time.monotonic() + 20.0
while not any(it.active for it in arm.fixtures.list()):
    assert time.monotonic() < end
    time.sleep(0.01)
circle, = arm.fixtures.list()
assert circle.kind == 'circle' and list(circle.values) == [0.2, 0.0, 0.1], circle
try:
    arm.move_jp([0.2, 0.0])
    raise AssertionError('it is in the circle')
except Refused as refused:
    assert 'virtual fixture' in str(refused), refused
while 'virtual fixture' not in arm.why():
    assert time.monotonic() < end, arm.why()
    time.sleep(0.01)
arm.fixtures.remove_added()
with arm.record(sys.argv[2], note='notebook') as recording:
    arm.move_jp([0.1, 0.0]).wait()
assert recording.path.stat().st_size > 1000
try:
    arm.record(sys.argv[2])
    raise AssertionError('nothing would be recorded')
except FileExistsError as refused:
    assert sys.argv[2] in str(refused), refused

def until(reached, send):
    while not reached(arm.setpoint_js().position):
        assert time.monotonic() < end, arm.setpoint_js()
        send()
        time.sleep(0.01)

end = time.monotonic() + 60.0
until(lambda at: at[0] > 0.15, lambda: arm.servo_jv([0.1, 0.0]))
arm.servo_jv([0.0, 0.0])
goal = arm.setpoint_js().position
until(lambda at: at[1] > 0.02, lambda: arm.interpolate_jp([goal[0], min(goal[1] + 0.03, 0.03)]))
until(lambda at: at[0] < 0.12, lambda: arm.servo_cv([0.0, -1e-4, 0.0]))
until(lambda at: not arm.setpoint_js().velocity.any(), arm.hold)
arm.move_cp([0.0, 0.0, 0.001794]).wait()
until(lambda at: at[0] > 0.05, lambda: arm.servo_cp([0.0, 7e-5, 0.00179]))
until(lambda at: not arm.setpoint_js().velocity.any(), arm.hold)
try:
    arm.move_cp([0.0, 0.0, 0.003])
    raise AssertionError('longer than the snake')
except OutOfReach as refused:
    assert ' mm' in str(refused), refused
held = arm.setpoint_js().position
arm.servo_jv([0.5, 0.5], clutch=True)
time.sleep(0.1)
assert abs(arm.setpoint_js().position - held).max() < 0.01
