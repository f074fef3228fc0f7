//! The JSON Schema of the configuration in `config/schema` follows from the code.

use std::path::Path;

use serde_json::{Value, json};

use super::Config;
use super::bounds::{BOUNDS, Bound};

/// Target of a node, through references and "this or null".
fn resolved(root: &Value, node: &Value) -> Value {
    let reference = |node: &Value| Some(node.get("$ref")?.as_str()?.strip_prefix('#')?.to_owned());
    if let Some(path) = reference(node) {
        return resolved(root, root.pointer(&path).unwrap());
    }
    let choices = node.get("anyOf").and_then(Value::as_array);
    let some = choices.and_then(|it| it.iter().find(|it| it["type"] != "null"));
    some.map_or_else(|| node.clone(), |some| resolved(root, some))
}

/// Schema path of a bound's key, as `$defs/TABLE/properties/KEY`.
fn pointer(root: &Value, key: &str) -> String {
    let mut table = String::new();
    let mut path = String::new();
    for name in key.split('.') {
        path = format!("{table}/properties/{}", name.trim_end_matches("[]"));
        let mut inner = root.pointer(&path).unwrap_or_else(|| panic!("{key}")).clone();
        if name.ends_with("[]") {
            inner = resolved(root, &inner)["items"].clone();
        }
        let names = inner["$ref"].as_str().or_else(|| inner["anyOf"][0]["$ref"].as_str());
        table = names.map_or_else(String::new, |name| name.trim_start_matches('#').to_owned());
    }
    path
}

fn write_bound(root: &mut Value, Bound { key, low, high, .. }: &Bound) {
    let number = |value: f64| match value.fract() {
        0.0 => json!(value as i64),
        _ => json!(value),
    };
    let path = pointer(root, key);
    let node = root.pointer_mut(&path).and_then(Value::as_object_mut).unwrap();
    node.remove("minimum");
    let low_key = if low.is_some() { "minimum" } else { "exclusiveMinimum" };
    node.insert(low_key.to_owned(), number(low.unwrap_or(0.0)));
    node.insert("maximum".to_owned(), number(*high));
}

/// After a change of the configuration: run this test with `I2RIS_UPDATE_SCHEMA=1` and commit the
/// file.
#[test]
fn the_schema_file_is_up_to_date() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/schema/controller.json");
    let mut schema = Value::from(schemars::schema_for!(Config));
    for bound in BOUNDS {
        write_bound(&mut schema, bound);
    }
    let text = serde_json::to_string_pretty(&schema).unwrap() + "\n";
    if std::env::var_os("I2RIS_UPDATE_SCHEMA").is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
}
