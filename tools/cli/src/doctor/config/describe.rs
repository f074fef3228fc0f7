//! A configuration as TOML, with the meaning of every key above it.

use std::fmt::Write as _;

use i2ris::config::Config;
use toml::Value;

use super::schema::{Node, controller};
use i2ris_report::Failure;

const WIDTH: usize = 110;

/// The configuration with every key. Optional keys that are absent appear as comments.
pub fn describe(config: &Config) -> Result<String, Failure> {
    let (table, schema) = (toml::Table::try_from(config)?, controller()?);
    let mut text = String::new();
    write_table(&mut text, &table, Node::root(&schema), "");
    Ok(text.trim_start_matches('\n').to_owned())
}

/// Writes plain values first: in TOML, everything after a table header belongs to that table.
fn write_table(text: &mut String, table: &toml::Table, node: Node<'_>, path: &str) {
    let keys = node.keys();
    for (key, inner) in &keys {
        let value = table.get(*key);
        if value.is_some_and(is_table) {
            continue;
        }
        if value.is_none() && !inner.keys().is_empty() {
            continue;
        }
        write_meaning(text, *inner);
        match value {
            Some(value) => drop(writeln!(text, "{key} = {value}")),
            None => drop(writeln!(text, "# {key} =")),
        }
    }
    for (key, inner) in keys {
        let full_name = if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
        match table.get(key) {
            Some(Value::Table(inside)) => {
                text.push('\n');
                write_meaning(text, inner);
                let _ = writeln!(text, "[{full_name}]");
                write_table(text, inside, inner, &full_name);
            }
            Some(Value::Array(list)) if list.iter().any(Value::is_table) => {
                let Some(entry) = inner.entry() else { continue };
                for inside in list.iter().filter_map(Value::as_table) {
                    text.push('\n');
                    write_meaning(text, inner);
                    let _ = writeln!(text, "[[{full_name}]]");
                    write_table(text, inside, entry, &full_name);
                }
            }
            _ => {}
        }
    }
}

fn is_table(value: &Value) -> bool {
    value.is_table() || value.as_array().is_some_and(|list| list.iter().any(Value::is_table))
}

fn write_meaning(text: &mut String, node: Node<'_>) {
    let meaning = node.meaning().unwrap_or_default();
    match node.range() {
        Some(range) => wrap(text, &format!("{meaning} Range: {range}.")),
        None => wrap(text, meaning),
    }
    for (word, meaning) in node.words() {
        wrap(text, &format!("\"{word}\": {meaning}"));
    }
}

fn wrap(text: &mut String, words: &str) {
    let mut line = String::from("#");
    for word in words.split_whitespace() {
        if line.len() + 1 + word.len() > WIDTH {
            text.push_str(&line);
            text.push('\n');
            "#".clone_into(&mut line);
        }
        line.push(' ');
        line.push_str(word);
    }
    if line.len() > 1 {
        text.push_str(&line);
        text.push('\n');
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn printed_configuration_is_equal_and_names_every_key() {
        for file in ["robot.toml", "robot-rs232.toml", "emulator.toml"] {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config").join(file);
            let config = Config::parse(&std::fs::read_to_string(&path).unwrap(), &path).unwrap();
            let text = describe(&config).unwrap();
            assert_eq!(Config::parse(&text, Path::new("printed.toml")).unwrap(), config, "{text}");
            let lines: Vec<&str> = text.lines().collect();
            let is_key = |line: &str| match line.strip_prefix("# ") {
                Some(absent) => absent.ends_with(" =") && absent.split(' ').count() == 2,
                None => line.starts_with('[') || line.contains(" ="),
            };
            for (number, line) in lines.iter().enumerate().filter(|(_, line)| is_key(line)) {
                assert!(
                    lines[number - 1].starts_with("# "),
                    "{file}: `{line}` has no meaning above it"
                );
                assert!(line.len() <= WIDTH);
            }
            assert!(
                text.contains("# cpu =\n") && text.contains("# \"stop-positive\": The hard stop"),
                "{text}"
            );
        }
    }
}
