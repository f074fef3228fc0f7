"""Why the robot does not move: sentence and advice of every cause, as in ``src/robot/reason.rs``.

Written by ``cargo run -p i2ris-record --example python_reasons``; a test compares it.
"""

from __future__ import annotations

FAULTS: dict[int, str] = {
    0: "none",
    1: "a drive reports an error",
    2: "a drive does not answer",
    3: "set-point and encoder are too far apart",
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
    5: "not enabled",
    6: "not homed: an axis does not know its zero",
    7: "no model is loaded",
    8: "malformed command",
    9: "outside the position limits",
    10: "not allowed in this state",
    11: "busy: a former command is being carried out",
    12: "the cause of the fault is still there",
    13: "sequence number did not rise",
    14: "not supported by this controller",
    15: "stamp in the future or deadline too long",
    16: "the drives are not ready",
    17: "this model is not staged",
    18: "no model was in use before this one",
    19: "the hysteresis memory is unknown: condition first, or force it",
    20: "the model is refused",
    21: "busy: the conditioning cycle is running; it ends by itself",
    22: "a virtual fixture is in the way",
    23: "the pose is out of reach",
    24: "another client holds the robot, and broke this stream off",
}
STOPS: dict[int, str] = {
    1: "commands came later than their deadline, and the robot stopped in between",
    2: "a drive gave no recent position, and the motion stopped",
}
CLIPS: dict[int, str] = {
    1: "the goal is outside the calibrated hull or the position limits",
    2: "a virtual fixture slows or stops the goal",
}
#: What to do, by kind (1 fault, 2 refusal, 3 stop, 4 clip) and number.
ADVICE: dict[tuple[int, int], str] = {
    (1, 1): "look the error code up in the drive's manual; then acknowledge",
    (1, 2): "check cable and supply (`i2ris doctor`); then acknowledge",
    (1, 3): "free the mechanism, or raise `current_limit_ma`, or lower the velocity; then acknowledge",
    (1, 4): "check STO and supply, and close EPOS Studio; then acknowledge",
    (1, 5): "check the drives with `i2ris doctor`; then acknowledge",
    (1, 6): "check the keys `homing_*` of the axis; then acknowledge",
    (1, 7): "keep the black box (`i2ris dump`) and report it",
    (1, 8): "take load off the computer, or give it real-time permission; then acknowledge",
    (1, 9): "look at the snake: slack or torn wire, wrong zero, old model, moved camera",
    (1, 10): "free the mechanism and look at the snake; then acknowledge",
    (2, 1): "correct the client: it sends NaN or an infinite value",
    (2, 2): "send faster; stamp with the monotonic clock of this computer",
    (2, 3): "start at `setpoint_js` and interpolate (`command.max_step_deg`)",
    (2, 4): "end the other client, or wait until it is silent (`i2ris monitor`)",
    (2, 5): "`i2ris command state enable`; after a fault, acknowledge it first",
    (2, 6): "straighten the snake, then `i2ris command state home`",
    (2, 7): "`i2ris model stage FILE` and `i2ris model activate ID`, or name it in the configuration",
    (2, 8): "correct the client: number of values, flags and client id",
    (2, 9): "command less, or correct the position limits of the axes",
    (2, 10): "bring the robot to the state that the command needs (`i2ris monitor`)",
    (2, 11): "wait until it is done, or `i2ris command state hold`",
    (2, 12): "remove the cause of the fault first",
    (2, 13): "correct the client: count the sequence number up by one per command",
    (2, 14): "use a model of angles, or another command",
    (2, 15): "stamp with the monotonic clock of this computer; ask for a deadline of 1 s at most",
    (2, 16): "wait for the drives to start; else `i2ris doctor`",
    (2, 17): "stage it first (`i2ris model list`)",
    (2, 18): "activate a model instead (`i2ris model list`)",
    (2, 19): "`i2ris command state condition`, or `--force`",
    (2, 20): "read the reason in the controller's answer to `i2ris model stage`",
    (2, 21): "wait until it is done, or `i2ris command state hold`",
    (2, 22): "go around the region (`i2ris command fixture list`), or switch the fixtures off",
    (2, 23): "command less, or calibrate a wider range",
    (2, 24): "stop sending for a second, then begin where the snake is",
    (3, 1): "send faster, or with a longer deadline; look at the load of the computer",
    (3, 2): "check cable and supply (`i2ris doctor`)",
    (4, 1): "command less, or calibrate a wider range",
    (4, 2): "go around the region (`i2ris command fixture list`)",
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
