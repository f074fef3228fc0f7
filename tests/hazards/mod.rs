//! The hazards of the design: see the table in `README.md` beside this file. Where a test of the
//! cycle or of the drives shows the control, the table names that one; the others are here.

use i2ris_testing::cycle::{with_family, with_other_families};

mod adaptation;
mod coverage;
mod documents;
mod drives;
mod models;
mod processes;
mod surroundings;

#[test]
fn other_families_fly_too() {
    with_other_families(&["h12_a_", "h16_five"]);
    // Without memory another method learns: see `tests/adaptation`.
    with_family("force-balance-fitted", &["h21_", "h22_", "h23_"]);
}
