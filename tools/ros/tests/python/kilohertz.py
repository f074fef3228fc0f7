# Watches `measured_js` at 1 kHz and sends commands at 1 kHz. Lost: samples that the reader missed. Steps: between the
# stamps of two samples; the sender publishes by its own clock, so an estimate can be repeated or skipped. Without one,
# as after a fault, the stamp is 0.
import math, threading, time
from cyclonedds.core import Listener
from cyclonedds.sub import DataReader
from crtk_arm import Arm, JointState, qos

class Losses(Listener):
    count = 0
    def on_sample_lost(self, reader, status):
        Losses.count = status.total_count

arm = Arm('i2ris')
arm.check_connections()
assert arm.home() and arm.enable(), arm.lines
reader = DataReader(arm.participant, arm.topic('measured_js', JointState), qos(depth=5000),
                    listener=Losses())
end, sent = time.time() + SECONDS, 0
def send():
    global sent
    start = time.time()
    while time.time() < end:
        t = time.time() - start
        arm.servo_jp([0.05 * math.sin(t), 0.04 * math.sin(1.3 * t)])
        sent += 1
        time.sleep(max(0.0, start + sent * 0.001 - time.time()))
sender = threading.Thread(target=send)
sender.start()
received, last, longest, over_ms = 0, 0, 0.0, {2: 0, 5: 0, 20: 0}
repeated = invalid = 0
while time.time() < end:
    for sample in reader.take(5000):
        if hasattr(sample, 'position'):
            stamp = sample.header.stamp.sec * 10**9 + sample.header.stamp.nanosec
            received, invalid = received + 1, invalid + (stamp == 0)
            step_ms = (stamp - last) * 1e-6 if stamp and last else 1.0
            last, longest = stamp, max(longest, step_ms)
            repeated += step_ms <= 0.0
            for limit in over_ms:
                over_ms[limit] += step_ms > limit
    time.sleep(0.01)
sender.join()
warnings = arm.lines["warning"]
print(f"{received} messages in {SECONDS} s; lost: {Losses.count}; repeated: {repeated};",
      f"invalid: {invalid};",
      f"longest step {longest:.1f} ms, steps over a number of ms: {over_ms};",
      f"{sent} commands sent; warnings: {warnings[-5:]}")
assert Losses.count == 0 and received > 0
