import time
from cyclonedds.core import Listener, Policy
from cyclonedds.sub import DataReader
from cyclonedds.pub import DataWriter
from crtk_arm import Arm, JointState, OperatingState, TFMessage, Topic, qos
arm = Arm('i2ris')
arm.check_connections()

class Mismatches(Listener):
    def __init__(self):
        super().__init__()
        self.wrong = []
    def on_requested_incompatible_qos(self, reader, status):
        self.wrong.append(('reader', status.last_policy_id))
    def on_offered_incompatible_qos(self, writer, status):
        self.wrong.append(('writer', status.last_policy_id))

mismatches = Mismatches()
fits = DataReader(arm.participant, arm.topic('measured_js', JointState), qos(reliable=False))
tf = DataReader(arm.participant, Topic(arm.participant, 'rt/tf', TFMessage), qos())
wrong_reader = DataReader(arm.participant, arm.topic('measured_js', JointState), qos(latched=True),
                          listener=mismatches)
wrong_writer = DataWriter(arm.participant, arm.topic('servo_jp', JointState), qos(reliable=False),
                          listener=mismatches)
end = time.time() + 20
while time.time() < end and (len(mismatches.wrong) < 2 or not fits.read(1) or not tf.read(1)):
    time.sleep(0.05)
assert {kind for kind, _ in mismatches.wrong} == {'reader', 'writer'}, mismatches.wrong
assert fits.read(1) and len(tf.take(1)[0].transforms) == 27
arm._wait(20.0, lambda: any('BEST_EFFORT' in it for it in arm.lines['warning']))
print(arm.lines['warning'])
