import math
states = [f'{m.state} {m.is_homed} {m.is_busy}' for m in seen['/operating_state']]
assert states == ['DISABLED True False', 'DISABLED True True', 'ENABLED True False'], states
stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in seen['/operating_state']]
assert stamps == [1700000000000000000 + k * 1000000 for k in (1, 20, 30)], stamps
servo = seen['/servo_jp']
assert len(servo) == 50 and list(servo[0].name) == ['pitch', 'yaw'], servo
assert abs(servo[0].position[0] - 0.051) < 1e-12 and len(servo[0].velocity) == 0, servo[0]
topics = ['/servo_jp', '/measured_js', '/operating_state']
frames = {m.header.frame_id for topic in topics for m in seen[topic]}
assert frames == {'i2ris_base'}, frames
assert len(seen['/measured_cp']) == len(seen['/tf']) == 5, {k: len(v) for k, v in seen.items()}
tip = seen['/measured_cp'][0]
assert tip.header.frame_id == 'i2ris_base' and tip.pose.position.x < -1e-4, tip
links = {t.child_frame_id: t for t in seen['/tf'][0].transforms}
assert len(links) == 27 and links['i2ris_yaw'].header.frame_id == 'i2ris_base', list(links)
assert abs(links['i2ris_yaw'].transform.rotation.w - math.cos(0.25)) < 1e-12, links['i2ris_yaw']
[description] = seen['/robot_description']
for element in ('<link name="i2ris_base"', '<joint name="pitch"'):
    assert element in description.data, description.data
