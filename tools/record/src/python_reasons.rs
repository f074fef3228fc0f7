//! The texts of all causes as a Python module.

use std::fmt::Write as _;

use i2ris::robot::{Cause, Quantity};

/// The complete module: sentences and advice by kind and number, and the units.
pub fn python_reasons() -> String {
    let mut text = String::from(
        "\"\"\"Why the robot does not move: sentence and advice of every cause, as in \
         ``src/robot/reason.rs``.\n\n\
         Written by ``cargo run -p i2ris-record --example python_reasons``; a test compares it.\n\
         \"\"\"\n\nfrom __future__ import annotations\n\n",
    );
    for (name, kind) in [("FAULTS", 1), ("REFUSALS", 2), ("STOPS", 3), ("CLIPS", 4)] {
        table(&mut text, name, kind, |cause| cause.sentence());
    }
    text.push_str("#: What to do, by kind (1 fault, 2 refusal, 3 stop, 4 clip) and number.\n");
    text.push_str("ADVICE: dict[tuple[int, int], str] = {\n");
    for cause in Cause::all().filter(|cause| cause.kind() < 5) {
        let (kind, number) = (cause.kind(), cause.number());
        // Writing to a string cannot fail.
        let _ = writeln!(text, "    ({kind}, {number}): {:?},", cause.advice());
    }
    text.push_str("}\n#: Units of measured values.\nQUANTITIES: dict[int, str] = {\n");
    for quantity in Quantity::ALL {
        let _ = writeln!(text, "    {}: {:?},", quantity.number(), quantity.text());
    }
    text.push_str("}\n");
    text
}

fn table(text: &mut String, name: &str, kind: u32, value: impl Fn(Cause) -> &'static str) {
    let _ = writeln!(text, "{name}: dict[int, str] = {{");
    if name == "FAULTS" {
        text.push_str("    0: \"none\",\n");
    }
    for cause in Cause::all().filter(|cause| cause.kind() == kind) {
        let _ = writeln!(text, "    {}: {:?},", cause.number(), value(cause));
    }
    text.push_str("}\n");
}
