//! Ceilings on the size of the house, in `tests/sizes.toml`.

use std::fs;
use std::path::Path;

/// Fails where `found` is above the ceiling of that name. `I2RIS_UPDATE=1` lowers it.
pub fn require_at_most(name: &str, found: usize) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/sizes.toml");
    let text = fs::read_to_string(&file).unwrap();
    let start = format!("{name} = ");
    let ceiling = text.lines().find_map(|line| line.strip_prefix(&start)).expect(name);
    let rule = "only an issue may raise tests/sizes.toml";
    let is_below = found <= ceiling.parse().unwrap();
    assert!(is_below, "{name}: {found}, and the ceiling is {ceiling}; {rule}");
    if std::env::var_os("I2RIS_UPDATE").is_some() {
        let line = |number: &str| format!("\n{start}{number}\n");
        fs::write(&file, text.replace(&line(ceiling), &line(&found.to_string()))).unwrap();
    }
}
