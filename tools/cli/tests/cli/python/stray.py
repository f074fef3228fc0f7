import sys, time
from i2ris.arm import Arm, Refused

with Arm(sys.argv[1], deadline_s=0.5) as arm:
    end = time.monotonic() + 20.0
    before = arm.operating_state().refused
    while (state := arm.operating_state()).refused < before + 50:
        assert time.monotonic() < end, state
        arm.servo_jp(arm.setpoint_js().position)
        time.sleep(0.005)
    assert state.own_refused == 0 and state.last_refusal == '', state
    try:
        while time.monotonic() < end:
            arm.servo_jp([0.5, 0.0])
            time.sleep(0.005)
        raise AssertionError('its own refusal is lost')
    except Refused as refused:
        assert refused.code == 3 and 'step too large' in str(refused), refused
