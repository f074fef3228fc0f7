from crtk_arm import Arm
arm = Arm('i2ris')
arm.check_connections(20.0)
assert arm.home() and arm.enable(), arm.lines
assert arm.move_jp([0.02, 0.0]).wait(), arm.lines
print('done')
