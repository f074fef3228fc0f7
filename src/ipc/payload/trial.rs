//! The trial that is being recorded. The controller does not read it: it is for monitors and
//! recordings.

use iceoryx2::prelude::ZeroCopySend;

use super::definition::payload;

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
    /// Flag: its recording has failed; the trial goes on unrecorded.
    pub const FAILED: u32 = 2;
}
