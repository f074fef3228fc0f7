//! Python, C++ and the manual have the same payloads and services as the controller.

use std::fs;
use std::process::Command;

use i2ris::ipc::payload::{Field, LAYOUTS, ModelReply, Payload, PayloadLayout};
use i2ris::ipc::{Direction, RequestService, Stream};
use i2ris_needs::needs;
use i2ris_testing::bench::repository;
use i2ris_testing::run_python;

/// The layouts of all payloads as JSON.
fn table() -> serde_json::Value {
    let field = |field: &Field| {
        let bytes = field.kind.size() * field.count;
        serde_json::json!({"name": field.name, "offset": field.offset, "bytes": bytes})
    };
    let payload = |layout: PayloadLayout| {
        let fields: Vec<_> = layout.fields.iter().map(field).collect();
        serde_json::json!({"type_name": layout.type_name, "name": layout.name,
                           "size": layout.size, "fields": fields})
    };
    LAYOUTS.into_iter().chain([ModelReply::LAYOUT]).map(payload).collect::<Vec<_>>().into()
}

#[needs("python: ctypes")]
#[test]
fn python_has_the_same_payloads() {
    let script = include_str!("python/payloads.py");
    run_python(script, &[&table().to_string()]);
}

#[needs("program: c++")]
#[test]
fn the_header_for_cpp_is_current_and_compiles() {
    let path = repository("tools/cpp/i2ris_payload.hpp");
    let written = fs::read_to_string(&path).unwrap();
    assert!(
        written == i2ris_record::generated::cpp_header(),
        "run cargo run -p i2ris-record --example cpp_header > tools/cpp/i2ris_payload.hpp"
    );
    let mut compiler = Command::new("c++");
    compiler.args("-std=c++17 -Wall -Wextra -Werror -fsyntax-only -include".split(' ')).arg(&path);
    let output = compiler.args(["-x", "c++", "/dev/null"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn the_manual_has_every_service_with_payload_and_direction() {
    let manual = fs::read_to_string(repository("tools/manual/src/shared-memory.md")).unwrap();
    let rows: Vec<Vec<&str>> = manual
        .lines()
        .filter(|line| line.starts_with("| `i2ris/"))
        .map(|line| line.split('|').map(str::trim).collect())
        .collect();
    let mut services = 0;
    let mut check = |service: &str, pattern: &str, payloads: &str, direction: &str| {
        let name = format!("`{service}`");
        let mut found = rows.iter().filter(|row| row[1].split(", ").any(|it| it == name));
        let row = found.next().unwrap_or_else(|| panic!("the manual does not have {service}"));
        assert!(found.next().is_none(), "{service} is listed twice");
        assert_eq!(row[2], pattern, "{service}");
        assert!(row[3].starts_with(payloads), "{service}: {row:?}");
        assert!(row[4].starts_with(direction), "{service}: {row:?}");
        services += 1;
    };
    for stream in Stream::ALL.iter().map(|stream| stream.properties()) {
        let direction = match stream.direction {
            Direction::Out => "out",
            Direction::In => "in",
            Direction::BetweenClients => "from the client",
        };
        let payload = format!("`{}`", stream.layout.name);
        check(stream.service, "publish-subscribe", &payload, direction);
    }
    for service in RequestService::ALL {
        let payloads = service.layouts().map(|layout| format!("`{}`", layout.name)).join(", ");
        check(service.service(), "request-response", &payloads, "");
    }
    let named: usize = rows.iter().map(|row| row[1].split(", ").count()).sum();
    assert_eq!(named, services, "a service of the manual is not in the table");
}
