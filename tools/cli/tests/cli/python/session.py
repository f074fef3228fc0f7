import math, sys, time
from i2ris.arm import Arm, NoController, Refused
from i2ris.payload import INTERFACE_VERSION

with Arm(sys.argv[1], deadline_s=0.5) as arm:
    assert arm.version().interface == INTERFACE_VERSION
    try:
        arm.state_command('enable')
        raise AssertionError('it is not homed')
    except Refused as refused:
        assert 'not homed' in str(refused), refused
    arm.state_command('home')
    assert arm.state_command('enable') == 'ENABLED'
    arm.wait_for(lambda state: state.state == 'ENABLED')
    assert arm.enable().wait().state == 'ENABLED', 'a script is run again'
    assert arm.wait_for(lambda state: state.state == 'ENABLED' and state.homed).fault == 'none'
    for k in range(200):
        arm.servo_jp([math.radians(5.0), math.radians(-3.0)])
        time.sleep(0.005)
        joints = arm.measured_js()
        if k > 20 and joints is not None and abs(math.degrees(joints.position[0]) - 5.0) < 1e-9:
            break
    assert abs(math.degrees(joints.position[1]) + 3.0) < 1e-9 and joints.valid, joints
    assert len(joints.position) == 2, joints
    state = arm.wait_for(lambda state: state.lease)
    assert state.accepted > 0, state
    assert list(arm.actuators.measured_js().measured_counts) == [40, -20]
    try:
        arm.servo_jp([])
        raise AssertionError('an empty pose was accepted')
    except ValueError:
        pass

try:
    Arm('nobody-' + sys.argv[1][-8:]).measured_js()
    raise AssertionError('connected without a controller')
except NoController as error:
    assert 'start i2ris-control' in str(error), error
