//! The JSON Schema of the snake in `config/schema` follows from the code.

use std::path::Path;

use super::config::SnakeConfig;

/// After a change of the snake: run this test with `I2RIS_UPDATE_SCHEMA=1` and commit the file.
#[test]
fn the_schema_file_is_up_to_date() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/schema/snake.json");
    let schema = serde_json::Value::from(schemars::schema_for!(SnakeConfig));
    let text = serde_json::to_string_pretty(&schema).unwrap() + "\n";
    if std::env::var_os("I2RIS_UPDATE_SCHEMA").is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
}
