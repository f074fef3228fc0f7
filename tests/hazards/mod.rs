//! The hazards of the design: see the table in `README.md` beside this file. Where a test of the
//! cycle or of the drives shows the control, the table names that one; the others are here, one
//! module per id.

use i2ris_testing::cycle::{with_family, with_other_families};

mod coverage;
mod documents;
mod drifting;
mod h02;
mod h03;
mod h06;
mod h08;
mod h10;
mod h12;
mod h13;
mod h15;
mod h16;
mod h17;
mod h18;
mod h21;
mod h22;
mod h23;
mod h36;

#[test]
fn other_families_fly_too() {
    with_other_families(&["h12_a_", "h16_five"]);
    // Without memory another method learns: see `tests/adaptation`.
    with_family("force-balance-fitted", &["h21_", "h22_", "h23_"]);
}
