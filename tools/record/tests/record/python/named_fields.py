import sys
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
reader = make_reader(open(sys.argv[1], 'rb'), decoder_factories=[DecoderFactory()])
names = {metadata.name: metadata.metadata for metadata in reader.iter_metadata()}
assert names['i2ris.header']['note'] == 'a test' and names['i2ris.outcome']['dropped'] == '0', names
assert [a.data for a in reader.iter_attachments()] == [b'robot_id = "x"']
counts = {}
for schema, channel, message, decoded in reader.iter_decoded_messages():
    k = counts[channel.topic] = counts.get(channel.topic, 0) + 1
    if channel.topic == '/measured_js':
        assert schema.name == 'sensor_msgs/msg/JointState'
        assert decoded.name == ['pitch', 'yaw'] and list(decoded.effort) == []
        assert abs(decoded.position[0] - k * 1e-4) < 1e-12
        assert abs(decoded.position[1] + k * 1e-4) < 1e-12
        stamp = decoded.header.stamp
        assert stamp.sec * 1000 + stamp.nanosec // 1000000 == 1700000000000 + k
    elif channel.topic == '/i2ris/actuators/measured_js':
        assert list(decoded.measured_counts) == [k, -k] and decoded.sequence == k
    elif channel.topic == '/i2ris/measured_js':
        assert bytes(decoded.model_id) == bytes([0xAB] * 32) and decoded.count == 2
    elif channel.topic == '/i2ris/period_statistics':
        assert decoded.lateness.p99_ns == 4321
assert counts == {'/measured_js': 2000, '/i2ris/measured_js': 2000,
                  '/i2ris/actuators/measured_js': 2000, '/i2ris/period_statistics': 2}, counts
