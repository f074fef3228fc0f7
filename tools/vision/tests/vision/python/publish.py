import sys, time
from i2ris.external import ExternalPublisher, NoController
publisher = ExternalPublisher(sys.argv[1])
for _ in range(50):
    publisher.publish(time.monotonic_ns(), [0.1, -0.2], [0.001, 0.002], 0.75)
    time.sleep(0.01)
publisher.publish_nothing(time.monotonic_ns())
time.sleep(0.5)
try:
    ExternalPublisher('nobody-' + sys.argv[1][-8:]).publish(1, [0.0])
except NoController as error:
    print(error)
