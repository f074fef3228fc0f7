"""Why the robot does not move: sentence and advice of every cause, as in ``src/robot/reason.rs``.

Written by ``cargo run -p i2ris-record --example python_reasons``; a test compares it.
"""

from __future__ import annotations

FAULTS: dict[int, str] = {
    0: "none",
    1: "a drive reports an error",
    2: "a drive does not answer",
    3: "setpoint and encoder are too far apart",
    4: "a drive left the enabled state by itself",
    5: "a drive did not reach the demanded state in time",
    6: "homing failed",
    7: "the model gave a value that is not finite",
    8: "too many late ticks: the computer does not keep up",
    9: "the snake is not where the model says",
    10: "a motor takes too much current for too long",
}
REFUSALS: dict[int, str] = {
    1: "a value is not finite",
    2: "stale: the command was older than its deadline when it arrived",
    3: "step too large: commands may move only a little at a time",
    4: "another client holds the lease",
    5: "the drives are off",
    6: "not homed: an axis does not know its zero",
    7: "no model is loaded",
    8: "malformed command",
    9: "outside the position limits",
    10: "not while the robot follows commands, and not while the controller ends",
    11: "busy: a former command is being carried out",
    12: "the cause of the fault is still there",
    13: "sequence number did not rise",
    14: "not supported by this controller",
    15: "stamp in the future or before the last one, or deadline too long",
    16: "the drives are not ready",
    17: "this model is not staged",
    18: "no model was in use before this one",
    19: "the hysteresis memory is unknown: condition first, or force it",
    20: "the model is refused",
    21: "busy: the conditioning cycle is running; it ends by itself",
    22: "a virtual fixture is in the way",
    23: "the pose is out of reach",
    24: "broken off: the robot was stopped meanwhile, or the stream fell silent in motion",
    25: "paused: the robot holds until it is resumed",
    26: "a fault is latched",
    27: "the drives are on",
    28: "there is no fault to acknowledge",
    29: "the watchdog runs, but could not stop every drive",
}
STOPS: dict[int, str] = {
    1: "commands came later than their deadline, and the robot stopped in between",
    2: "a drive gave no recent position, and the motion stopped",
    3: "no watchdog watches: nothing stops the drives if the controller dies",
    4: "a later command broke it off",
    5: "a virtual fixture came into the way and broke it off",
    6: "a position limit of the motors or joints broke it off",
    7: "a fault broke it off",
    8: "the border of the calibrated range broke it off",
    9: "the velocity or acceleration limit of the joints broke it off",
    10: "a drive did not take its setpoints, and the motion stopped",
}
CLIPS: dict[int, str] = {
    1: "the goal is outside the calibrated range; the snake goes to the nearest pose",
    2: "a virtual fixture slows or stops the goal",
    3: "the goal is beyond a position limit of a motor; the snake goes to the nearest pose",
    4: "the goal is beyond a joint limit; the snake goes to the nearest pose",
}
#: What to do, by kind (1 fault, 2 refusal, 3 stop, 4 clip) and number.
ADVICE: dict[tuple[int, int], str] = {
    (1, 1): "look the error code up in the drive's manual; then `i2ris command state acknowledge`",
    (1, 2): "check cable and supply (`i2ris doctor`); then `i2ris command state acknowledge`",
    (1, 3): "free the mechanism, or raise `current_limit_ma`, or go slower; then `i2ris command state acknowledge`",
    (1, 4): "check STO and supply, and close EPOS Studio; then `i2ris command state acknowledge`",
    (1, 5): "check the drives with `i2ris doctor`; then `i2ris command state acknowledge`",
    (1, 6): "check the keys `homing_*` of the axis; then `i2ris command state acknowledge`",
    (1, 7): "keep the black box (`i2ris record dump`) and report it",
    (1, 8): "take load off the computer, or give it real-time permission; then `i2ris command state acknowledge`",
    (1, 9): "look at wires, zero, model and camera; then `i2ris command state acknowledge`",
    (1, 10): "free the mechanism and look at the snake; then `i2ris command state acknowledge`",
    (2, 1): "correct the client: it sends NaN or an infinite value",
    (2, 2): "send faster; stamp with the monotonic clock of this computer",
    (2, 3): "start at `setpoint_js` and interpolate (`command.max_step_deg`)",
    (2, 4): "end the other client, or wait until it is silent (`i2ris status`)",
    (2, 5): "`i2ris enable`",
    (2, 6): "straighten the snake, then `i2ris home`",
    (2, 7): "`i2ris model use FILE`, or name it in the configuration",
    (2, 8): "correct the client: number of values, flags and client id",
    (2, 9): "command less, or correct the position limits of the axes or `joint_limits`",
    (2, 10): "`i2ris command state hold`; a controller that ends has to be started again",
    (2, 11): "wait until it is done, or `i2ris command state hold` and a second",
    (2, 12): "remove the cause of the fault first",
    (2, 13): "correct the client: count the sequence number up by one per command",
    (2, 14): "use a model of angles, or another command",
    (2, 15): "stamp with the monotonic clock of this computer, in the order of sending; ask for a deadline of 1 s at most",
    (2, 16): "wait for the drives to start; else `i2ris doctor`",
    (2, 17): "`i2ris model use FILE`; `i2ris model show` lists what is loaded",
    (2, 18): "`i2ris model use FILE` instead",
    (2, 19): "`i2ris command state condition`, or `--force`",
    (2, 20): "read the reason in the controller's answer to `i2ris model use`",
    (2, 21): "wait until it is done, or `i2ris command state hold` and a second",
    (2, 22): "go around the region (`i2ris command fixture list`), or switch the fixtures off",
    (2, 23): "command less, or calibrate a wider range",
    (2, 24): "stop sending for a second, `hold` as this client, then begin where the snake is",
    (2, 25): "`i2ris command state resume`",
    (2, 26): "remove the cause of the fault (`i2ris status`), then `i2ris command state acknowledge`",
    (2, 27): "`i2ris disable`",
    (2, 28): "go on: nothing is to be done",
    (2, 29): "read the log of `i2ris-watchdog`; let it hold every port, or end the process that `i2ris doctor` names",
    (3, 1): "send faster, or with a longer deadline; look at the load of the computer",
    (3, 2): "take load off the computer if ticks are missed (`i2ris status`), else check cable and supply (`i2ris doctor`)",
    (3, 3): "start `i2ris-watchdog --config FILE` again, and read its log",
    (3, 4): "ask who gave it (`i2ris status`), then give the command again",
    (3, 5): "switch the fixtures off (`i2ris command fixture off`), then again",
    (3, 6): "begin further inside the limits, or correct them",
    (3, 7): "remove the cause (`i2ris status`), then give the command again",
    (3, 8): "begin further inside the calibrated range, or calibrate a wider one",
    (3, 9): "raise `joint_limits`, or calibrate again: the model jumps there",
    (3, 10): "read which object the drive refuses in the log, then `i2ris disable`",
    (4, 1): "command less, or calibrate a wider range",
    (4, 2): "go around the region (`i2ris command fixture list`)",
    (4, 3): "command less, or check `position_min_counts`, `position_max_counts`",
    (4, 4): "command less, or check the positions in `joint_limits`",
}
#: Units of measured values.
QUANTITIES: dict[int, str] = {
    0: "",
    1: "deg",
    2: "counts",
    3: "mA",
    4: "ms",
    5: "late ticks",
    6: "values",
    7: "error code",
    8: "statusword",
    9: "sequence number",
    10: "mm",
}
#: What a state says about a command that was accepted before, as in ``src/ipc/client/effect.rs``: busy, ended
#: without its effect, done, or broken off (x). A letter for each state and all combinations of flags, the last
#: one fastest.
PROGRESS_STATES = ("DISABLED", "ENABLED", "PAUSED", "FAULT")
PROGRESS_FLAGS = ("homed", "busy", "model", "memory_known", "holding", "at_rest", "off", "broken_off")
PROGRESS: dict[str, str] = {
    "enable": (
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb"
        "bbbbbbbbbbbbbbbbbbbbbbbbbbxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxbbbbbbbbbbbb"
        "bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbdddddddddddddddddddddddddddddddddddddddddddddddddd"
        "dddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddd"
        "dddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddd"
        "ddxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb"
        "bbbbbbbbbbbbbbbbbbbbbbbbbbbbxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxbbbbbbbbbb"
        "bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxx"
    ),
    "disable": (
        "eeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb"
        "bbbbbbbbbbbbbbbbbbbbbbbbbbeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddbbbbbbbbbbbb"
        "bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeedd"
        "eeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddee"
        "ddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeeddeedd"
        "eedd"
    ),
    "pause": (
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxbbbbddddbbbbddddbbbbddddbbbbddddbbbbddddbbbbddddbbbbddddbbbbddddbbbbddddbbbbddddbbbbddddbbbbddddbbbb"
        "ddddbbbbddddbbbbddddbbbbddddbbbbddddbbbbddddbbbbddddbbbbddddbbbbddddbbbbddddbbbbddddbbbbddddbbbbddddbb"
        "bbddddbbbbddddbbbbddddbbbbddddbbbbddddbbbbddddbbbbddddxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxx"
    ),
    "resume": (
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb"
        "bbbbbbbbbbbbbbbbbbbbbbbbbbxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxbbbbbbbbbbbb"
        "bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbdddddddddddddddddddddddddddddddddddddddddddddddddd"
        "dddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddd"
        "dddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddd"
        "ddxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb"
        "bbbbbbbbbbbbbbbbbbbbbbbbbbbbxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxbbbbbbbbbb"
        "bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxx"
    ),
    "home": (
        "exexexexexexexexexexexexexexexexexexexexexexexexexexexexexexexexbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbx"
        "bxbxbxbxbxbxbxbxbxbxbxbxbxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxbxbxbxbxbxbx"
        "bxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxexexexexexexexexexexexexexexexexexexexexexexexexex"
        "exexexexexexexbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxdxdxdxdxdxdxdxdxdxdxdxdx"
        "dxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbx"
        "bxexexexexexexexexexexexexexexexexexexexexexexexexexexexexexexexexbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbx"
        "bxbxbxbxbxbxbxbxbxbxbxbxbxbxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxbxbxbxbxbx"
        "bxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxx"
    ),
    "unhome": (
        "dddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddd"
        "ddddddddddddddddddddddddddeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeee"
        "eeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeedddddddddddddddddddddddddddddddddddddddddddddddddd"
        "ddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddeeeeeeeeeeeeeeeeeeeeeeee"
        "eeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeee"
        "eedddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddd"
        "ddddddddddddddddddddddddddddeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeee"
        "eeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeexxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxx"
    ),
    "condition": (
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxexexexexexexexexdx"
        "dxdxdxdxdxdxdxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxdxdxdxdxdxdxdxdxdxdxdxdx"
        "dxdxdxdxexexexexexexexexdxdxdxdxdxdxdxdxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbx"
        "bxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxx"
    ),
    "acknowledge": (
        "ddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb"
        "bbbbbbbbbbbbbbbbbbbbbbbbbbddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddbbbbbbbbbbbb"
        "bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbdddddddddddddddddddddddddddddddddddddddddddddddddd"
        "dddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddd"
        "dddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddd"
        "dddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddd"
        "dddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddddd"
        "ddddddddddddddddddddddddddddddddddddddddddddddddddddddxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb"
        "bbbb"
    ),
    "hold": (
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxbbbbddddxxxxxxxxbbbbddddxxxxxxxxbbbbddddxx"
        "xxxxxxbbbbddddxxxxxxxxbbbbddddxxxxxxxxbbbbddddxxxxxxxxbbbbddddxxxxxxxxbbbbddddxxxxxxxxbbbbddddxxxxxxxx"
        "bbbbddddxxxxxxxxbbbbddddxxxxxxxxbbbbddddxxxxxxxxbbbbddddxxxxxxxxbbbbddddxxxxxxxxbbbbddddxxxxxxxxbbbbdd"
        "ddxxxxxxxxbbbbddddxxxxxxxxbbbbddddxxxxxxxxbbbbddddxxxxxxxxbbbbddddxxxxxxxxbbbbddddxxxxxxxxbbbbddddxxxx"
        "xxxxbbbbddddxxxxxxxxbbbbddddxxxxxxxxbbbbddddxxxxxxxxbbbbddddxxxxxxxxbbbbddddxxxxxxxxbbbbddddxxxxxxxxbb"
        "bbddddxxxxxxxxbbbbddddxxxxxxxxbbbbddddxxxxxxxxbbbbddddxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxx"
    ),
    "move": (
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdx"
        "dxdxdxdxdxdxdxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxdxdxdxdxdxdxdxdxdxdxdxdx"
        "dxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxdxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbxbx"
        "bxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"
        "xxxx"
    ),
}
#: What is known of the power of the drives, by the flag ``off``.
POWER = ("not every drive says that it is off", "every drive is off")
#: Distance of the setpoint from the goal at which a motion has arrived, deg.
ARRIVAL_DEG = 0.516
#: The effect is there so long after the robot is no longer busy, or not at all, s; that of drives that go off.
SETTLE_S, DRIVES_S = 1.0, 5.0
#: A controller that has not reported its state for so long hangs, s.
SILENCE_S = 3.0
