"""Python side of i2ris, the controller of the I2RIS snake robot.

Import the modules by name, so that each needs only its own packages:

- ``i2ris.arm``: commanding and watching the robot (extra ``client``)
- ``i2ris.payload``: the messages in shared memory
- ``i2ris.markers``: bending angles from ArUco markers (extra ``markers``); ``python -m i2ris.markers``
- ``i2ris.model``: calibrations, models and networks (``i2ris-native``); ``i2ris.benchmark``: emulated snakes, a benchmark
- ``i2ris.lerobot``: data sets of LeRobot from exported tables; ``python -m i2ris.lerobot``
- ``i2ris.external``: publishing angles to the controller (extra ``publish``)
"""
