import sys
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
reader = make_reader(open(sys.argv[1], 'rb'), decoder_factories=[DecoderFactory()])
seen, types = {}, {}
for schema, channel, message, decoded in reader.iter_decoded_messages():
    seen.setdefault(channel.topic, []).append(decoded)
    types[channel.topic] = schema.name
assert types['/operating_state'] == 'crtk_msgs/msg/OperatingState', types
assert types['/servo_jp'] == 'sensor_msgs/msg/JointState', types
[urdf] = [a for a in reader.iter_attachments() if a.name == 'robot.urdf']
assert urdf.data.decode() == seen['/robot_description'][0].data
