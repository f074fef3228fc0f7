"""Why the robot does not move: text and advice of every cause, as in ``src/robot/reason.rs``.

Written by ``cargo run -p i2ris-record --example python_reasons``; a test compares it.
"""

from __future__ import annotations

FAULTS: dict[int, str] = {
    0: "none",
    1: "a drive reports an error",
    2: "a drive does not answer",
    3: "following error too large",
    4: "a drive left the enabled state unexpectedly",
    5: "a drive did not reach the requested state in time",
    6: "homing failed",
    7: "the model gave a value that is not finite",
    8: "too many late ticks, or a suspend: the computer cannot keep up",
    9: "camera and model disagree on the pose",
    10: "motor over-current for too long",
}
REFUSALS: dict[int, str] = {
    1: "a value is not finite",
    2: "stale: the command was older than its deadline when it arrived",
    3: "step too large: too far from the previous command or the pose",
    4: "another client holds the lease",
    5: "the drives are off",
    6: "not homed: the zero of an axis is unknown",
    7: "no model is loaded",
    8: "malformed command",
    9: "outside the position limits, a move longer than 60 s, or more than 8 fixtures",
    10: "not possible while the robot follows commands, or while the controller shuts down",
    11: "busy: the previous command is still running",
    12: "the cause of the fault persists",
    13: "the sequence number did not increase",
    14: "not supported by this controller",
    15: "stamp in the future or older than the previous one, or deadline too long",
    16: "the drives are not ready",
    17: "this model is not staged",
    18: "no previous model to return to",
    19: "the hysteresis memory is unknown: run a conditioning cycle, or use --force",
    20: "the controller refused the model",
    21: "busy: the conditioning cycle is still running",
    22: "a virtual fixture is in the way",
    23: "the pose is out of reach",
    24: "stream interrupted: (1) the robot was stopped, or (2) this client's stream fell silent or reached a limit in motion",
    25: "paused: the robot holds until it is resumed",
    26: "a fault is latched",
    27: "the drives are on",
    28: "there is no fault to acknowledge",
    29: "the watchdog is running, but cannot stop every drive",
}
STOPS: dict[int, str] = {
    1: "commands arrived after their deadline; the robot stopped in between",
    2: "no recent position from a drive, or an axis lost its zero; the motion stopped",
    3: "no active watchdog: nothing will stop the drives if the controller dies; the robot has not stopped",
    4: "move, homing or conditioning interrupted by a later command",
    5: "interrupted: a virtual fixture is in the way",
    6: "interrupted: motor or joint position limit reached",
    7: "interrupted by a fault",
    8: "interrupted: border of the calibrated range reached",
    9: "interrupted: velocity or acceleration limit of the joints reached",
    10: "a drive did not accept its setpoints; the motion stopped",
}
CLIPS: dict[int, str] = {
    1: "the goal is outside the calibrated range; the snake goes to the nearest pose",
    2: "a virtual fixture slows or stops the motion",
    3: "the goal is beyond a position limit of a motor; the snake goes to the nearest pose",
    4: "the goal is beyond a joint limit; the snake goes to the nearest pose",
}
#: What to do, by kind (1 fault, 2 refusal, 3 stop, 4 clip) and number.
ADVICE: dict[tuple[int, int], str] = {
    (1, 1): "look up the error code in the drive's manual; then `i2ris command state acknowledge`",
    (1, 2): "check cable and supply (`i2ris doctor`); then `i2ris command state acknowledge`",
    (1, 3): "free the mechanism, raise `current_limit_ma`, or command slower motion; then `i2ris command state acknowledge`",
    (1, 4): "check STO and supply, and close EPOS Studio; then `i2ris command state acknowledge`",
    (1, 5): "read why in the controller's log; then `i2ris command state acknowledge`, and repeat if the computer was busy, or `i2ris doctor`",
    (1, 6): "read why in the controller's log; check the keys `homing_*` of the axis; then `i2ris command state acknowledge`",
    (1, 7): "save the black box (`i2ris record replay`) and report it",
    (1, 8): "reduce the load on the computer, do not let it sleep, or grant real-time permission; then `i2ris command state acknowledge`",
    (1, 9): "check camera, wires, zero and model; then `i2ris command state acknowledge`",
    (1, 10): "free the mechanism and inspect the snake; then `i2ris command state acknowledge`",
    (2, 1): "fix the client: it sends NaN or an infinite value",
    (2, 2): "send faster; stamp with the monotonic clock of this computer",
    (2, 3): "start at `setpoint_js` and interpolate: at most `command.max_step_deg` per command (motors: `max_step_counts`)",
    (2, 4): "end the other client, or wait until it stops sending (`i2ris status`)",
    (2, 5): "`i2ris enable`",
    (2, 6): "straighten the snake, then `i2ris home`",
    (2, 7): "`i2ris model use FILE`, or name it in the configuration",
    (2, 8): "fix the client: number of values, flags and client id",
    (2, 9): "correct the command, the fixtures or the limits (`position_min_counts`, `position_max_counts`, `joint_limits`)",
    (2, 10): "`i2ris command state hold`; if the controller is shutting down, start it again",
    (2, 11): "wait until it is done, or send `i2ris command state hold` and wait 1 s",
    (2, 12): "remove the cause of the fault first",
    (2, 13): "fix the client: increase the sequence number by one per command",
    (2, 14): "use a model whose outputs are angles, or another command",
    (2, 15): "stamp with the monotonic clock of this computer, in sending order; use a deadline of at most 1 s",
    (2, 16): "wait for the drives to start; if they do not, run `i2ris doctor`",
    (2, 17): "`i2ris model use FILE`; `i2ris model show` lists what is loaded",
    (2, 18): "`i2ris model use FILE` instead",
    (2, 19): "`i2ris command state condition`, or `--force`",
    (2, 20): "read the reason in the controller's reply to `i2ris model use`",
    (2, 21): "wait until it is done, or send `i2ris command state hold` and wait 1 s",
    (2, 22): "go around the region (`i2ris command fixture list`), or switch the fixtures off",
    (2, 23): "command a smaller angle, or calibrate a wider range",
    (2, 24): "(1) read `i2ris status`, (2) fix the stream; stay silent for 1 s, send `hold` as this client, then restart from `setpoint_js`",
    (2, 25): "`i2ris command state resume`",
    (2, 26): "remove the cause of the fault (`i2ris status`), then `i2ris command state acknowledge`",
    (2, 27): "`i2ris disable`",
    (2, 28): "continue; no action is needed",
    (2, 29): "give the watchdog access to every port (see its log), or end it (see `i2ris doctor`): the robot then runs without a watchdog",
    (3, 1): "send faster, or use a longer deadline; check the load on the computer",
    (3, 2): "missed ticks (`i2ris status`): reduce the load; else check cable and supply (`i2ris doctor`); zero lost: home again",
    (3, 3): "start `i2ris-watchdog --config FILE` again and read its log",
    (3, 4): "find the sender (`i2ris status`), then repeat the command",
    (3, 5): "switch the fixtures off (`i2ris command fixture off`), then repeat the command",
    (3, 6): "start further inside the limits, or correct them",
    (3, 7): "remove the cause (`i2ris status`), then repeat the command",
    (3, 8): "start further inside the calibrated range, or calibrate a wider one",
    (3, 9): "raise the rates in `joint_limits`, or, if the model jumps there, calibrate again",
    (3, 10): "`i2ris disable`, then find in the log which object the drive refuses",
    (4, 1): "command a smaller angle, or calibrate a wider range",
    (4, 2): "go around the region (`i2ris command fixture list`)",
    (4, 3): "command a smaller angle, or check `position_min_counts`, `position_max_counts`",
    (4, 4): "command a smaller angle, or check the positions in `joint_limits`",
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
#: Progress of an accepted command by operating state, as in ``src/ipc/client/effect.rs``: busy, ended without
#: effect, done, or interrupted (x). A letter for each state and all combinations of flags, the last one
#: fastest.
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
#: Power of the drives, by the flag ``off``.
POWER = ("a drive has not confirmed power-off", "every drive is off")
#: Distance of the setpoint from the goal at which a motion has arrived, deg.
ARRIVAL_DEG = 0.516
#: Longest time from the end of busy to the effect, s; and the same for drives that power off.
SETTLE_S, DRIVES_S = 1.0, 5.0
#: A controller that has not reported its state for this time hangs, s.
SILENCE_S = 3.0
