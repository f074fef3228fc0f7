import math, sys, threading, time
from i2ris.arm import Arm, OutOfReach, Refused, Stopped

domain, second, broken = sys.argv[1:]
end = time.monotonic() + 20.0
while True:
    try:
        arm = Arm(domain, deadline_s=0.5).__enter__()
        arm.wait_for(lambda state: not state.busy)
        break
    except Exception:
        assert time.monotonic() < end
        time.sleep(0.05)

try:
    arm.enable()
    raise AssertionError('it is not homed')
except Refused as refused:
    assert refused.code == 6 and 'not homed' in refused.reason, refused
try:
    arm.home()
    raise AssertionError('homed without confirmation')
except ValueError as error:
    assert 'straighten' in str(error), error
arm.home(straightened=True).wait()
assert arm.enable().wait().state == 'ENABLED'
arm.move_jp([math.radians(3.0), math.radians(-2.0)]).wait()
assert abs(math.degrees(arm.setpoint_js().position[0]) - 3.0) < 0.2, arm.setpoint_js()
try:
    arm.move_jp([math.radians(60.0), 0.0]).wait()
    raise AssertionError('out of reach')
except OutOfReach as out:
    assert '60' in str(out), out
arm.move_jp([0.0, 0.0]).wait()
moving = arm.move_jp([math.radians(10.0), 0.0])
assert not moving.is_done()
arm.hold()
try:
    moving.wait()
    raise AssertionError('it was stopped')
except Stopped:
    pass
arm.move_jp([0.0, 0.0]).wait()
try:
    while True:
        arm.servo_jp([math.radians(20.0), 0.0])
        time.sleep(0.005)
except Refused as refused:
    assert 'step too large' in refused.reason, refused

# The hold was for every other client.
time.sleep(1.0)
done, lead = threading.Event(), Arm(domain, deadline_s=0.5)
def move():
    start = time.monotonic()
    while not done.is_set():
        t = time.monotonic() - start
        lead.servo_jp([math.radians(2.0 * math.sin(t)), math.radians(2.0 * math.sin(1.3 * t))])
        time.sleep(0.005)
mover = threading.Thread(target=move)
mover.start()
try:
    arm.wait_for(lambda state: state.accepted > 50)
    first = arm.model.list()
    assert first.active.family == 'force-balance', first
    assert first.staged is None and first.previous is None, first
    try:
        arm.model.stage(broken).wait()
        raise AssertionError('a broken model')
    except Refused as refused:
        assert 'broken.json' in str(refused), refused
    try:
        lead.model.rollback(force=True)
        raise AssertionError('nothing to go back to')
    except Refused as refused:
        assert 'no previous model to return to' in str(refused), refused
    staging, looks = arm.model.stage(second), 0
    while not staging.is_done():
        looks += 1
        time.sleep(0.001)
    assert looks > 0, 'a stream would have waited'
    staged = staging.wait()
    assert staged.active.id == first.active.id and staged.staged.id != first.active.id, staged
    try:
        lead.model.activate('0' * 64, force=True)
        raise AssertionError('another model than the staged one')
    except Refused as refused:
        assert 'not staged' in str(refused), refused
    lead.model.activate(staged.staged.id, force=True)
    def in_use(model):
        limit = time.monotonic() + 15.0
        while (models := arm.model.list()).active.id != model:
            assert time.monotonic() < limit, models
            time.sleep(0.02)
        return models
    swapped = in_use(staged.staged.id)
    assert swapped.previous.id == first.active.id, swapped
    lead.model.rollback(force=True)
    in_use(first.active.id)
    before = arm.operating_state().accepted
    state = arm.wait_for(lambda state: state.accepted > before + 20)
    assert state.state == 'ENABLED' and state.fault == 'none', state
finally:
    done.set()
    mover.join()
lead.close()
arm.close()
print('swapped and back')
