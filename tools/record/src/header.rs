//! The payloads as a C++ header, for clients on the C++ package of iceoryx2.

use std::fmt::Write as _;

use crate::layout::{Kind, Payload, SPAN_MEMBERS, payloads};

/// The whole header. Sizes and offsets are asserted in it, so a compiler that lays things out
/// otherwise says so.
#[must_use]
pub fn header() -> String {
    let mut text = String::from(
        "// The messages of i2ris in shared memory, byte for byte as in src/ipc/payload, where fields are explained.\n\
         // Written by `cargo run -p i2ris-record --example header`; a test compares and compiles
         // it.\n\
         #pragma once\n\n#include <cstddef>\n#include <cstdint>\n\nnamespace i2ris {\n\n",
    );
    let members: String = SPAN_MEMBERS.iter().fold(String::new(), |all, member| {
        all + &format!("    std::uint64_t {member};\n")
    });
    let _ = write!(text, "struct SpanSummary {{\n{members}}};\n\n");
    for (type_name, payload) in payloads() {
        structure(&mut text, type_name, &payload);
    }
    text.push_str("} // namespace i2ris\n");
    text
}

fn structure(text: &mut String, type_name: &str, payload: &Payload) {
    let Payload { name, size, fields } = payload;
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "struct {name} {{\n    static constexpr const char* IOX2_TYPE_NAME = \"{type_name}\";"
    );
    for field in *fields {
        let (kind, count) = if field.is_span {
            ("SpanSummary", 1)
        } else {
            (cpp(field.kind), field.count)
        };
        let entries = if count == 1 {
            String::new()
        } else {
            format!("[{count}]")
        };
        let _ = writeln!(text, "    {kind} {}{entries};", field.name);
    }
    let _ = writeln!(text, "}};\nstatic_assert(sizeof({name}) == {size});");
    for field in *fields {
        let _ = writeln!(
            text,
            "static_assert(offsetof({name}, {}) == {});",
            field.name, field.offset
        );
    }
    text.push('\n');
}

const fn cpp(kind: Kind) -> &'static str {
    match kind {
        Kind::U8 => "std::uint8_t",
        Kind::U16 => "std::uint16_t",
        Kind::U32 => "std::uint32_t",
        Kind::I32 => "std::int32_t",
        Kind::U64 => "std::uint64_t",
        Kind::F64 => "double",
    }
}
