//! Generated files for other languages: the payloads as a C++ header; text and advice of every
//! cause, and the effects of commands, as a Python module.

use std::fmt::Write as _;

use i2ris::ipc::client::Progress;
use i2ris::ipc::client::effect::{ARRIVAL, SETTLE, SETTLE_OFF, SILENCE};
use i2ris::ipc::payload::{
    Field, FieldType, LAYOUTS, OperatingStateMsg, Payload, PayloadLayout, SpanSummary,
};
use i2ris::ipc::ready::{ICEORYX2_VERSION, INTERFACE_VERSION};
use i2ris::robot::{Cause, KnownPower, OperatingState, Quantity, StateCommand, Stop};

/// The complete module: texts and advice by kind and number, and the units.
pub fn python_reasons() -> String {
    let mut text = String::from(
        "\"\"\"Why the robot does not move: text and advice of every cause, as in \
         ``src/robot/reason.rs``.\n\n\
         Written by ``cargo run -p i2ris-record --example python_reasons``; a test compares it.\n\
         \"\"\"\n\nfrom __future__ import annotations\n\n",
    );
    for (name, kind) in [("FAULTS", 1), ("REFUSALS", 2), ("STOPS", 3), ("CLIPS", 4)] {
        table(&mut text, name, kind);
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
    effects(&mut text);
    text
}

/// Progress of a command by operating state: a letter for every state and all flags.
fn effects(text: &mut String) {
    use OperatingStateMsg as Msg;
    let all_flags = [
        ("homed", Msg::HOMED),
        ("busy", Msg::BUSY),
        ("model", Msg::MODEL),
        ("memory_known", Msg::MEMORY_KNOWN),
        ("holding", Msg::HOLDING),
        ("at_rest", Msg::AT_REST),
        ("off", Msg::OFF),
        ("broken_off", Msg::broken_off_by(Some(Stop::Command))),
    ];
    let letter = |command: StateCommand, number: usize| {
        let set = all_flags.iter().rev().enumerate().filter(|(bit, _)| number >> bit & 1 == 1);
        let flags = set.map(|(_, flag)| flag.1).sum();
        let state = OperatingState::ALL[number >> all_flags.len()].number();
        match (Msg { state, flags, ..Msg::default() }).progress(command, 0) {
            Progress::Busy => 'b',
            Progress::Ended => 'e',
            Progress::Done => 'd',
            Progress::Interrupted(_) => 'x',
        }
    };
    let names = all_flags.map(|(name, _)| format!("{name:?}")).join(", ");
    let states = OperatingState::ALL.iter().map(|it| format!("{:?}", it.text()));
    let _ = write!(
        text,
        "#: Progress of an accepted command by operating state, as in \
         ``src/ipc/client/effect.rs``: busy, ended without\n#: effect, done, or interrupted (x). \
         A letter for each state and all combinations of flags, the last one\n#: fastest.\n\
         PROGRESS_STATES = ({})\nPROGRESS_FLAGS = ({names})\nPROGRESS: dict[str, str] = {{\n",
        states.collect::<Vec<_>>().join(", ")
    );
    let waits = |it: &&StateCommand| !matches!(it, StateCommand::Release | StateCommand::Fixture);
    for command in StateCommand::ALL.iter().filter(waits) {
        let all = 0..OperatingState::ALL.len() << all_flags.len();
        let letters: Vec<char> = all.map(|number| letter(*command, number)).collect();
        let lines = letters.chunks(102).map(|line| line.iter().collect::<String>());
        let lines: String = lines.map(|line| format!("        {line:?}\n")).collect();
        let _ = writeln!(text, "    {:?}: (\n{lines}    ),", command.text());
    }
    let _ = writeln!(
        text,
        "}}\n#: Power of the drives, by the flag ``off``.\n\
         POWER = ({:?}, {:?})\n\
         #: Distance of the setpoint from the goal at which a motion has arrived, deg.\n\
         ARRIVAL_DEG = {:.3}\n\
         #: Longest time from the end of busy to the effect, s; and the same for drives that power \
         off.\nSETTLE_S, DRIVES_S = {:?}, {:?}\n\
         #: A controller that has not reported its state for this time hangs, s.\nSILENCE_S = {:?}",
        KnownPower::NotOff.text(),
        KnownPower::Off.text(),
        ARRIVAL.to_degrees(),
        SETTLE.as_seconds(),
        SETTLE_OFF.as_seconds(),
        SILENCE.as_seconds()
    );
}

fn table(text: &mut String, name: &str, kind: u32) {
    let _ = writeln!(text, "{name}: dict[int, str] = {{");
    if name == "FAULTS" {
        text.push_str("    0: \"none\",\n");
    }
    for cause in Cause::all().filter(|cause| cause.kind() == kind) {
        let _ = writeln!(text, "    {}: {:?},", cause.number(), cause.sentence());
    }
    text.push_str("}\n");
}

/// The complete header. It asserts sizes and offsets: a compiler with other layouts rejects it.
pub fn cpp_header() -> String {
    let mut text = String::from(
        "// The messages of i2ris in shared memory, byte for byte as in src/ipc/payload, where \
         fields are explained.\n\
         // Written by `cargo run -p i2ris-record --example cpp_header`; a test compares and \
         compiles it.\n\
         #pragma once\n\n#include <cstddef>\n#include <cstdint>\n\nnamespace i2ris {\n\n",
    );
    // Writing to a string cannot fail.
    let _ = write!(
        text,
        "// The second word of the file `ready`. A controller with a different one is from a \
         different release.\n\
         constexpr int INTERFACE_VERSION = {INTERFACE_VERSION};\n\
         // Versions of iceoryx2 refuse each other.\n\
         constexpr const char* ICEORYX2_VERSION = \"{ICEORYX2_VERSION}\";\n\n"
    );
    let members = SpanSummary::LAYOUT.fields.iter();
    let members: String = members.map(|it| format!("    std::uint64_t {};\n", it.name)).collect();
    let _ = write!(text, "struct SpanSummary {{\n{members}}};\n\n");
    for payload in &LAYOUTS {
        write_struct(&mut text, payload);
    }
    text.push_str("} // namespace i2ris\n");
    text
}

fn write_struct(text: &mut String, payload: &PayloadLayout) {
    let PayloadLayout { name, type_name, size, fields } = payload;
    let _ = writeln!(text, "struct {name} {{");
    let _ = writeln!(text, "    static constexpr const char* IOX2_TYPE_NAME = \"{type_name}\";");
    for field in *fields {
        let entries = match field.count {
            1 => String::new(),
            count => format!("[{count}]"),
        };
        let _ = writeln!(text, "    {} {}{entries};", cpp_type(field), field.name);
    }
    let _ = writeln!(text, "}};\nstatic_assert(sizeof({name}) == {size});");
    for Field { name: field, offset, .. } in *fields {
        let _ = writeln!(text, "static_assert(offsetof({name}, {field}) == {offset});");
    }
    text.push('\n');
}

const fn cpp_type(field: &Field) -> &'static str {
    match field.kind {
        FieldType::U8 => "std::uint8_t",
        FieldType::U16 => "std::uint16_t",
        FieldType::U32 => "std::uint32_t",
        FieldType::I32 => "std::int32_t",
        FieldType::U64 => "std::uint64_t",
        FieldType::F64 => "double",
        FieldType::Payload(inner) => inner.name,
    }
}
