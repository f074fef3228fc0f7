import sys, time
sys.path[:0] = ["plugins/lerobot_robot_i2ris", "plugins/lerobot_teleoperator_i2ris"]
from lerobot.robots.utils import make_robot_from_config
from lerobot.teleoperators.utils import make_teleoperator_from_config
from lerobot_robot_i2ris import I2risConfig
from lerobot_teleoperator_i2ris import I2risTeleopConfig
robot = make_robot_from_config(I2risConfig(domain=sys.argv[1]))
hand = make_teleoperator_from_config(I2risTeleopConfig(domain=sys.argv[1]))
robot.connect(); hand.connect()
assert set(robot.get_observation()) == set(robot.observation_features)
begin = robot.get_observation()["pitch.pos"]
for step in range(30):
    yaw = robot.get_observation()["yaw.pos"]
    robot.send_action({"pitch.pos": begin + 0.001 * step, "yaw.pos": yaw})
    time.sleep(0.01)
assert robot.get_observation()["pitch.pos"] > begin + 0.02, robot.get_observation()
assert abs(hand.get_action()["pitch.pos"] - begin) < 0.05
assert set(hand.get_action()) == set(robot.action_features)
robot.disconnect(); hand.disconnect()
