//! The report of `i2ris vision` at the end.

use std::fmt::Write as _;

use i2ris_vision::rest_pose::RestPose;
use i2ris_vision::session::{Session, SessionStatistics};
use i2ris_vision::setup::VisionSetup;

/// Reference, counts of good rows and of every cause.
pub fn report(setup: &VisionSetup, session: &Session) -> String {
    let mut text = String::new();
    for (view, rest) in setup.views.iter().zip(session.rests()) {
        line(&mut text, &format!("view {}: {}", view.name, rest_words(rest)));
    }
    let SessionStatistics { rows, good, causes, skew } = session.statistics();
    line(&mut text, &format!("{good} of {rows} rows have angles"));
    if setup.views.len() == 2 {
        line(&mut text, &format!("pairs at most {:.1} ms apart", skew.as_seconds() * 1e3));
    }
    for ((view, cause), count) in causes {
        line(&mut text, &format!("{count:>7}  {view}: {cause}"));
    }
    text
}

/// A straight pose in words.
pub fn rest_words(rest: &RestPose) -> String {
    let RestPose { angle_deg, spread_deg, length_px, tip_px: [x, y] } = rest;
    format!(
        "rest at {angle_deg:+.3} deg, spread {spread_deg:.3} deg, length {length_px:.1} px, \
         tip at {x:.1}, {y:.1} px"
    )
}

fn line(text: &mut String, words: &str) {
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{words}");
}
