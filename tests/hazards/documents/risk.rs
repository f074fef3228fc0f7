//! The table of risks: every hazard with severity, and probability before and after its control.

use super::{SAFETY, hazards, require_up_to_date};

/// Severity, probability before and after, and residual risk. Sorted like the hazards.
const RATINGS: &[(&str, [u32; 3], &str)] = &[
    ("H01", [4, 4, 1], "a drive that reports a target which it does not have"),
    ("H02", [3, 5, 1], "motion until the deadline: 50 ms by default, 1 s at most"),
    (
        "H03",
        [3, 3, 1],
        "computer or cable fail as a whole: only a relay on the STO inputs acts, which is not part \
         of this software",
    ),
    ("H04", [4, 4, 1], "a damaged frame with a correct checksum of 16 bits"),
    ("H05", [4, 3, 1], "motors swapped between the drives and the snake"),
    ("H06", [3, 4, 2], "homing in a bent pose: zero is where the snake is then"),
    ("H07", [3, 4, 1], "a hull that was calibrated on another snake"),
    ("H08", [3, 3, 2], "a model that passes all checks but no longer fits the snake"),
    ("H09", [4, 3, 1], "a wrong goal within all limits is followed"),
    ("H10", [2, 4, 2], "with `limits.overrun_ticks = 0` late ticks are counted without a fault"),
    ("H11", [3, 3, 1], "a wrong value within its range"),
    ("H12", [4, 3, 2], "without a camera, slack within the following error is not seen"),
    ("H13", [2, 4, 1], "lost lines and records, which are counted"),
    ("H14", [4, 3, 1], "a commander that sends the wrong pose"),
    ("H15", [4, 2, 1], "a second computer on the same drives"),
    ("H16", [2, 4, 2], "monitors have been tried on emulated drives only"),
    ("H17", [2, 3, 1], "names of files with a wrong date"),
    ("H18", [3, 3, 1], "a motor that was turned by hand while the drive had no power"),
    ("H20", [3, 4, 2], "a slow push moves the correction, within its budget"),
    ("H21", [3, 3, 2], "a camera error too small for the checks"),
    ("H22", [2, 4, 1], "a motion that excites a parameter only weakly"),
    ("H23", [3, 3, 1], "a correction in the direction of the goal"),
    ("H24", [3, 4, 1], "clocks of two computers that differ by less than two seconds"),
    ("H25", [4, 3, 1], "a process of the same user that writes into another client's memory"),
    ("H26", [4, 3, 1], "a user who may command by ROS, where that is allowed"),
    (
        "H27",
        [4, 3, 1],
        "a computer that stops without a suspend: only a relay on the STO inputs acts",
    ),
    ("H28", [4, 4, 1], "lost lines, which are counted"),
    ("H29", [4, 3, 1], "a stop that the middleware does not deliver"),
    ("H30", [3, 4, 1], "a delay that exists from the first message on"),
    (
        "H31",
        [4, 4, 1],
        "motion for the silence time of its profile, and 30 s for a separate pedal; never tested \
         with real devices",
    ),
    ("H32", [4, 4, 1], "a device that reports a wrong centre"),
    ("H33", [3, 3, 1], "a firmware that changes its controls but keeps its ids"),
    ("H34", [3, 4, 2], "a camera that is turned after the view was measured or typed"),
    ("H35", [3, 3, 1], "a second camera takes over when the first is silent for a second"),
    (
        "H36",
        [3, 4, 2],
        "a network that is wrong where neither its recording nor the checks reached",
    ),
    ("H37", [4, 4, 2], "properties that a drive does not report; no real drive was read yet"),
];

const HEAD: &str = "\
| id | hazard | control | severity | before | after | what remains |
|---|---|---|---|---|---|---|
";

fn table() -> String {
    let mut table = HEAD.to_owned();
    for hazard in hazards() {
        let [id, name, control] = [&hazard[0], &hazard[1], &hazard[2]];
        let rating = RATINGS.iter().find(|(rated, ..)| rated == id);
        let (_, [severity, before, after], remains) =
            rating.unwrap_or_else(|| panic!("{id} has no rating: add it to {}", file!()));
        table += &format!(
            "| {id} | {name} | {control} | {severity} | {} | {} | {remains} |\n",
            risk(*severity, *before),
            risk(*severity, *after)
        );
    }
    table
}

fn risk(severity: u32, probability: u32) -> String {
    let word = match severity * probability {
        ..=4 => "low",
        5..=9 => "medium",
        10.. => "high",
    };
    format!("{probability}: {word}")
}

#[test]
fn the_table_of_risks_is_up_to_date() {
    require_up_to_date(SAFETY, "risk", &table());
}

#[test]
fn every_rating_has_hazard_and_controls_never_worsen_it() {
    let hazards = hazards();
    for (id, [severity, before, after], _) in RATINGS {
        assert!(hazards.iter().any(|hazard| hazard[0] == *id), "{id}");
        assert!((1..=4).contains(severity) && (1..=5).contains(before), "{id}");
        assert!((1..=*before).contains(after), "{id}");
    }
}
