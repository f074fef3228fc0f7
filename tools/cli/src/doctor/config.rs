//! `i2ris doctor config`: inspects a configuration without starting anything, and prints it as TOML
//! with the meaning of every key above it, from the JSON Schema.
//!
//! The crates that read these files derive the schemas in their tests, so that no program depends
//! on the derivation; `config/schema` holds the result.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use i2ris::config::{Config, PortConfig};
use i2ris::model::Model;
use i2ris_calibration::hand_limits::HandLimits;
use i2ris_report::Failure;
use i2ris_report::exit::{Coded, NOT_READY};
use serde_json::{Value, json};

const TEMPLATES: [&str; 2] = [
    include_str!("../../../../config/robot.toml"),
    include_str!("../../../../config/robot-rs232.toml"),
];

/// Mark after every line that the operator must check.
const MARK: &str = " # CHECK";

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris doctor config my-robot.toml
  i2ris doctor config --all config/robot.toml       all keys with values and meanings")]
pub struct Arguments {
    /// The configuration
    file: PathBuf,
    /// Print all keys, including defaults, with values and meanings
    #[arg(long)]
    all: bool,
    /// Print JSON; with --all, without meanings
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let Arguments { file, all, json } = arguments;
    if !all {
        return check(file, *json);
    }
    let config = Config::load(file)?;
    match json {
        true => println!("{}", serde_json::to_string_pretty(&config)?),
        false => print!("{}", describe(&config)?),
    }
    Ok(())
}

fn check(file: &Path, json: bool) -> Result<(), Failure> {
    let config = Config::load_and_check_files(file)?;
    let (shown, robot) = (file.display(), &config.robot_id);
    let (motors, axes) = (config.motors(), config.axes().count());
    let of_line = |port: &PortConfig| config.line_findings(port, port.nominal_exchange());
    let mut findings = as_delivered(&fs::read_to_string(file)?, &config);
    findings.extend(config.ports.iter().flat_map(of_line).map(|finding| finding.to_string()));
    let model = config.control.model.as_deref().map(Model::load_trusted).transpose()?;
    let hand = model.map(|model| HandLimits::new(&model, &config.limits, &config.joint_limits));
    let [stale_ms, lost_ms] =
        [config.feedback_stale(), config.feedback_lost()].map(|age| age.as_seconds() * 1e3);
    if json {
        let found = json!({
            "file": file, "valid": true, "robot_id": robot, "motors": motors,
            "axes": axes, "feedback_stale_ms": stale_ms, "feedback_lost_ms": lost_ms, "hand": hand,
            "not_ready": findings,
        });
        println!("{found}");
    } else {
        println!("{shown}: valid; robot {robot}, {axes} axes, {motors} of the snake");
        println!(
            "the motion stops if a position is older than {stale_ms:.0} ms, FAULT after \
             {lost_ms:.0} ms"
        );
        for port in &config.ports {
            let line = port.describe_line(port.nominal_exchange());
            println!("{}: {line}", port.device.display());
        }
        if let Some(delay_s) = config.command.tremor_filter_delay_s() {
            let (hz, delay_ms) = (config.command.tremor_filter_hz, delay_s * 1e3);
            println!("the tremor filter of {hz} Hz delays the goal by {delay_ms:.0} ms");
        }
        hand.iter().for_each(|hand| println!("with its model, {hand}"));
        config.disabled_monitors().iter().for_each(|watch| println!("off: {watch}"));
        findings.iter().for_each(|finding| println!("{finding}"));
    }
    match findings.len() {
        0 => Ok(()),
        count => {
            let sentence = format!("{shown}: {count} line(s) are not ready");
            Err(Coded { code: NOT_READY, sentence }.into())
        }
    }
}

/// Template lines still to be filled in by the operator: marked CHECK, with the value as delivered.
/// Deleting the mark confirms the value. A serial number of 0 is never valid.
pub fn as_delivered(text: &str, config: &Config) -> Vec<String> {
    let is_delivered = |line: &&str| {
        let mut delivered = TEMPLATES.iter().flat_map(|template| template.lines());
        delivered.any(|delivered| delivered.ends_with(MARK) && delivered == line.trim())
    };
    let lines = text.lines().enumerate().filter(|(_, line)| is_delivered(line));
    let marked = lines.map(|(index, line)| {
        let line = line.trim().trim_end_matches(MARK);
        format!("line {}: {line}: as delivered; correct it, or delete the mark CHECK", index + 1)
    });
    let unknown = config.axes().filter(|axis| axis.serial_number == 0);
    let unknown = unknown.map(|axis| {
        let motor = axis.motor;
        format!("ports.axes[motor {motor}].serial_number = 0: no drive has it (object 0x1018:04)")
    });
    marked.chain(unknown).collect()
}

const WIDTH: usize = 110;

/// The configuration with every key. Optional keys that are absent appear as comments.
fn describe(config: &Config) -> Result<String, Failure> {
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
        if value.map_or(!inner.keys().is_empty(), is_table) {
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
            Some(toml::Value::Table(inside)) => {
                text.push('\n');
                write_meaning(text, inner);
                let _ = writeln!(text, "[{full_name}]");
                write_table(text, inside, inner, &full_name);
            }
            Some(toml::Value::Array(list)) if list.iter().any(toml::Value::is_table) => {
                let Some(entry) = inner.entry() else { continue };
                for inside in list.iter().filter_map(toml::Value::as_table) {
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

fn is_table(value: &toml::Value) -> bool {
    value.is_table() || value.as_array().is_some_and(|list| list.iter().any(toml::Value::is_table))
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

fn controller() -> serde_json::Result<Value> {
    serde_json::from_str(include_str!("../../../../config/schema/controller.json"))
}

#[derive(Debug, Clone, Copy)]
struct Node<'a> {
    root: &'a Value,
    here: &'a Value,
}

impl<'a> Node<'a> {
    fn root(root: &'a Value) -> Self {
        Self { root, here: root }
    }

    /// The keys of a table, in alphabetical order; empty if it is not a table.
    fn keys(self) -> Vec<(&'a str, Self)> {
        let object = self.resolved().here.get("properties").and_then(Value::as_object);
        let node = |(key, here): (&'a String, &'a Value)| (key.as_str(), Self { here, ..self });
        object.into_iter().flatten().map(node).collect()
    }

    fn entry(self) -> Option<Self> {
        self.resolved().here.get("items").map(|here| Self { here, ..self })
    }

    fn meaning(self) -> Option<&'a str> {
        self.here.get("description").and_then(Value::as_str)
    }

    fn range(self) -> Option<String> {
        let bound = |name: &str| self.here.get(name).filter(|value| value.is_number());
        let high = bound("maximum")?;
        let from = bound("minimum").map(|low| format!("{low} to {high}"));
        Some(from.unwrap_or_else(|| format!("above 0, at most {high}")))
    }

    /// The permitted words with their meanings; empty where any value of the type is permitted.
    fn words(self) -> Vec<(&'a str, &'a str)> {
        let choices = self.resolved().here.get("oneOf").and_then(Value::as_array);
        let word = |choice: &'a Value| {
            Some((choice.get("const")?.as_str()?, choice.get("description")?.as_str()?))
        };
        choices.into_iter().flatten().filter_map(word).collect()
    }

    /// Follows references and "this or null".
    fn resolved(self) -> Self {
        let here = self.here;
        let name = here.get("$ref").and_then(Value::as_str);
        if let Some(name) = name.and_then(|name| name.strip_prefix("#/")) {
            let target = name.split('/').try_fold(self.root, |node, part| node.get(part));
            return target.map_or(self, |here| Self { here, ..self }.resolved());
        }
        let some = |choice: &&Value| choice.get("type").and_then(Value::as_str) != Some("null");
        let choices = here.get("anyOf").and_then(Value::as_array);
        match choices.and_then(|choices| choices.iter().find(some)) {
            Some(here) => Self { here, ..self }.resolved(),
            None => self,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn printed_configuration_is_equal_and_names_every_key() {
        for file in ["robot.toml", "robot-rs232.toml", "emulator.toml"] {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config").join(file);
            let config = Config::parse(&fs::read_to_string(&path).unwrap(), &path).unwrap();
            let text = describe(&config).unwrap();
            assert_eq!(Config::parse(&text, Path::new("printed.toml")).unwrap(), config, "{text}");
            let lines: Vec<&str> = text.lines().collect();
            let is_key = |line: &str| match line.strip_prefix("# ") {
                Some(absent) => absent.ends_with(" =") && absent.split(' ').count() == 2,
                None => line.starts_with('[') || line.contains(" ="),
            };
            for (number, line) in lines.iter().enumerate().filter(|(_, line)| is_key(line)) {
                let has_meaning = lines[number - 1].starts_with("# ");
                assert!(has_meaning, "{file}: `{line}` has no meaning above it");
                assert!(line.len() <= WIDTH);
            }
            let parts = ["# cpu =\n", "# \"stop-positive\": The hard stop"];
            assert!(parts.iter().all(|part| text.contains(part)), "{text}");
        }
    }

    fn config_file(name: &str) -> String {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config");
        fs::read_to_string(folder.join(name)).unwrap()
    }

    fn of(kind: &str) -> Value {
        serde_json::from_str(&config_file(&format!("schema/{kind}.json"))).unwrap()
    }

    fn unknown(table: &toml::Table, node: Node<'_>, path: &str, found: &mut Vec<String>) {
        for (key, value) in table {
            let name = format!("{path}{key}");
            let Some((_, inner)) = node.keys().into_iter().find(|(name, _)| name == key) else {
                found.push(format!("{name}: not in the schema"));
                continue;
            };
            match value {
                toml::Value::Table(table) => unknown(table, inner, &format!("{name}."), found),
                toml::Value::Array(list) => {
                    for entry in list.iter().filter_map(toml::Value::as_table) {
                        unknown(entry, inner.entry().unwrap(), &format!("{name}."), found);
                    }
                }
                _ => {}
            }
        }
    }

    #[test]
    fn every_configuration_key_here_is_in_the_schema() {
        for (kind, file) in [
            ("controller", "robot.toml"),
            ("controller", "robot-rs232.toml"),
            ("controller", "emulator.toml"),
            ("snake", "snakes/steel.toml"),
            ("snake", "snakes/brass.toml"),
            ("snake", "snakes/loose.toml"),
            ("snake", "snakes/multi.toml"),
            ("vision", "vision.toml"),
        ] {
            let schema = of(kind);
            let table: toml::Table = config_file(file).parse().unwrap();
            let mut found = Vec::new();
            unknown(&table, Node::root(&schema), "", &mut found);
            assert!(found.is_empty() && !table.is_empty(), "{file}: {found:?}");
        }
    }

    fn without_meaning(node: Node<'_>, path: &str, found: &mut Vec<String>, count: &mut usize) {
        for (key, inner) in node.keys() {
            *count += 1;
            if inner.meaning().is_none_or(str::is_empty) {
                found.push(format!("{path}{key}"));
            }
            without_meaning(inner, &format!("{path}{key}."), found, count);
            if let Some(entry) = inner.entry() {
                without_meaning(entry, &format!("{path}{key}."), found, count);
            }
        }
    }

    #[test]
    fn schema_keys_have_a_meaning_and_tables_are_closed() {
        for (kind, least) in [("controller", 60), ("snake", 20), ("vision", 12)] {
            let schema = of(kind);
            let (mut found, mut count) = (Vec::new(), 0);
            without_meaning(Node::root(&schema), "", &mut found, &mut count);
            let is_whole = found.is_empty() && count > least;
            assert!(is_whole, "{kind}: {count} keys, without meaning: {found:?}");
        }
        let schema = controller().unwrap();
        assert_eq!(schema["additionalProperties"], false);
        assert!(schema["$schema"].as_str().unwrap().contains("json-schema.org"));
        for table in ["control", "command", "limits", "compensation", "virtual_fixtures", "ports"] {
            assert!(schema["properties"][table]["description"].is_string(), "{table}");
        }
        assert_eq!(schema["required"], json!(["robot_id", "ports"]));
        let limits = &schema["$defs"]["LimitConfig"];
        assert_eq!(limits["additionalProperties"], false);
        assert_eq!(limits["properties"]["overrun_ticks"]["default"].as_u64(), Some(100));
    }

    #[test]
    fn a_misspelt_key_is_not_in_the_schema() {
        let table: toml::Table = "[control]\nrate_herz = 3".parse().unwrap();
        let (schema, mut found) = (controller().unwrap(), Vec::new());
        unknown(&table, Node::root(&schema), "", &mut found);
        assert_eq!(found, ["control.rate_herz: not in the schema"]);
    }
}
