//! Streams between clients: what a hand holds, and the trial that is recorded. The controller reads
//! neither: they are for monitors and recordings.

use iceoryx2::prelude::ZeroCopySend;

use super::definition::payload;

payload! {
    /// `teleop`, between clients: what a person does with an input device, 20 times a second and
    /// with every change of the clutch, while `i2ris teleop` runs.
    TeleopMsg "I2risTeleopV1": message {
        /// Counts up by one per message of one client.
        pub sequence: u64,
        /// Time of the message.
        pub stamp_ns: u64,
        /// The client that steers.
        pub client_id: u64,
        /// Directions of +pitch (first) and +yaw in the picture: right, up.
        pub view: [[f64; 2]; 2],
        /// Deflection to the right and up in the picture, each -1 to 1.
        pub push: [f64; 2],
        /// Share of the motion that reaches the snake.
        pub scale: f64,
        /// When the newest event of a device came to the computer, by the kernel's monotonic clock.
        /// 0: no event yet, or the device reports no time.
        pub event_ns: u64,
        /// The number of the first command that this event is part of.
        pub command_sequence: u64,
        /// Time of the last mark of the trial by a button. 0: never.
        pub mark_ns: u64,
        /// 0 rate, 1 position, 2 hybrid.
        pub mode: u32,
        /// Sum of [`TeleopMsg::OPEN`] and the other flags.
        pub flags: u32,
        /// Why the clutch is open; UTF-8, padded with 0.
        pub why_open: [u8; 128],
    }
}

impl TeleopMsg {
    /// Flag: the clutch is open, the snake holds.
    pub const OPEN: u32 = 1;
    /// Flag: the view was measured, not typed.
    pub const VIEW_MEASURED: u32 = 2;
}

payload! {
    /// `trial`, between clients: the trial of a study and its newest mark, twice a second and with
    /// every mark, from the recorder of the trial.
    TrialMsg "I2risTrialV1": message {
        /// Counts up by one per message of one client.
        pub sequence: u64,
        /// Time of the message.
        pub stamp_ns: u64,
        /// The client that records.
        pub client_id: u64,
        /// When the trial began.
        pub started_ns: u64,
        /// When the newest mark was set.
        pub mark_ns: u64,
        /// Number of the newest mark, from 1; 0: none yet.
        pub mark_number: u32,
        /// Sum of [`TrialMsg::ENDED`] and the other flags.
        pub flags: u32,
        /// Participant, condition and number, as `P07-joystick-02`; UTF-8, padded with 0.
        pub trial: [u8; 64],
        /// Text of the newest mark; UTF-8, padded with 0.
        pub mark: [u8; 64],
    }
}

impl TrialMsg {
    /// Flag: the last message of the trial.
    pub const ENDED: u32 = 1;
    /// Flag: its recording has failed; the trial continues unrecorded.
    pub const FAILED: u32 = 2;
}
