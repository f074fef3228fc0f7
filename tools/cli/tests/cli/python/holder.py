import sys, time
from i2ris.arm import Arm

with Arm(sys.argv[1], deadline_s=0.5) as arm:
    arm.servo_jp([0.0, 0.0])
    print('commanding', flush=True)
    sys.stdin.read()
