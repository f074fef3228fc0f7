//! The commands that change the operating state.

use super::numbered_enum::numbered_enum;

numbered_enum! {
    /// Commands that change the state.
    StateCommand {
        /// DISABLED or acknowledged FAULT to ENABLED: targets preloaded, drives on. The robot
        /// holds.
        Enable = 1, "enable";
        /// Any state to DISABLED: decelerate, hold, power off in order.
        Disable = 2, "disable";
        /// ENABLED to PAUSED: decelerate and hold.
        Pause = 3, "pause";
        /// PAUSED to ENABLED: servo commands are taken again, from where the snake is.
        Resume = 4, "resume";
        /// Here is zero: homing method 37 on every drive. From DISABLED only.
        Home = 5, "home";
        /// Forget the zero. From DISABLED only.
        Unhome = 6, "unhome";
        /// A decaying stroke that wipes the hysteresis memory, from ENABLED only; busy meanwhile.
        Condition = 7, "condition";
        /// The operator has seen the fault: reset the drives, FAULT to DISABLED once the cause is
        /// gone.
        Acknowledge = 8, "acknowledge";
        /// Give the lease back.
        Release = 9, "release";
        /// ENABLED: stop and hold, whatever is followed; the next servo command is followed again.
        Hold = 10, "hold";
        /// ENABLED: go to a pose, from rest to rest; busy meanwhile. Only with a pose, by the
        /// request `move_jp`.
        Move = 11, "move";
    }
}
