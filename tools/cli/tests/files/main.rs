//! `i2ris` on files alone: transcripts, next to this folder. Their commands compute without pause,
//! so they are kept apart from emulated drives, whose pseudo-terminals would starve.
#![allow(clippy::unwrap_used)]

use i2ris_testing::transcript;

#[test]
fn commands_print_what_their_transcripts_show() {
    let folder = transcript::root().join("tools/cli/tests/transcripts");
    for entry in std::fs::read_dir(folder).unwrap() {
        transcript::check(&entry.unwrap().path());
    }
}
