//! JSON Schema of the configuration files: keys, types, and the meaning of each key.
//!
//! The crates that read these files derive the schemas in their tests, so that no program depends
//! on the derivation; `config/schema` holds the result.

use serde_json::Value;

/// The schema of the configuration of `i2ris-control`.
pub fn controller() -> serde_json::Result<Value> {
    serde_json::from_str(include_str!("../../../../../config/schema/controller.json"))
}

/// A node of a schema, and the schema that its references point into.
#[derive(Debug, Clone, Copy)]
pub struct Node<'a> {
    root: &'a Value,
    here: &'a Value,
}

impl<'a> Node<'a> {
    pub fn root(root: &'a Value) -> Self {
        Self { root, here: root }
    }

    /// The keys of a table, in alphabetical order; empty if it is not a table.
    pub fn keys(self) -> Vec<(&'a str, Self)> {
        let object = self.resolved().here.get("properties").and_then(Value::as_object);
        object
            .into_iter()
            .flatten()
            .map(|(key, here)| (key.as_str(), Self { here, ..self }))
            .collect()
    }

    pub fn entry(self) -> Option<Self> {
        let node = self.resolved();
        node.here.get("items").map(|here| Self { here, ..self })
    }

    pub fn meaning(self) -> Option<&'a str> {
        self.here.get("description").and_then(Value::as_str)
    }

    /// The range of a number, if limited.
    pub fn range(self) -> Option<String> {
        let bound = |name: &str| self.here.get(name).filter(|value| value.is_number());
        let high = bound("maximum")?;
        Some(match bound("minimum") {
            Some(low) => format!("{low} to {high}"),
            None => format!("above 0, at most {high}"),
        })
    }

    /// The permitted words with their meanings; empty where any value of the type is permitted.
    pub fn words(self) -> Vec<(&'a str, &'a str)> {
        let choices = self.resolved().here.get("oneOf").and_then(Value::as_array);
        let word = |choice: &'a Value| {
            Some((choice.get("const")?.as_str()?, choice.get("description")?.as_str()?))
        };
        choices.into_iter().flatten().filter_map(word).collect()
    }

    /// Follows references and "this or null".
    fn resolved(self) -> Self {
        let here = self.here;
        if let Some(name) =
            here.get("$ref").and_then(Value::as_str).and_then(|name| name.strip_prefix("#/"))
        {
            let target = name.split('/').try_fold(self.root, |node, part| node.get(part));
            return target.map_or(self, |here| Self { here, ..self }.resolved());
        }
        let some = |choice: &&Value| choice.get("type").and_then(Value::as_str) != Some("null");
        match here
            .get("anyOf")
            .and_then(Value::as_array)
            .and_then(|choices| choices.iter().find(some))
        {
            Some(here) => Self { here, ..self }.resolved(),
            None => self,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use super::*;

    fn config_file(name: &str) -> String {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config");
        fs::read_to_string(folder.join(name)).unwrap()
    }

    fn of(kind: &str) -> Value {
        serde_json::from_str(&config_file(&format!("schema/{kind}.json"))).unwrap()
    }

    /// Every key of a table that is not in the schema, or has no meaning there.
    fn unknown(table: &toml::Table, node: Node<'_>, path: &str, found: &mut Vec<String>) {
        for (key, value) in table {
            let name = format!("{path}{key}");
            let Some((_, inner)) = node.keys().into_iter().find(|(name, _)| name == key) else {
                found.push(format!("{name}: not in the schema"));
                continue;
            };
            if inner.meaning().is_none_or(str::is_empty) {
                found.push(format!("{name}: no meaning"));
            }
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
    fn every_configuration_key_here_has_a_meaning_in_the_schema() {
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
            assert!(
                found.is_empty() && count > least,
                "{kind}: {count} keys, without meaning: {found:?}"
            );
        }
        let schema = controller().unwrap();
        assert_eq!(schema["additionalProperties"], false);
        let limits = &schema["$defs"]["LimitConfig"];
        assert_eq!(
            (
                &limits["additionalProperties"],
                limits["properties"]["overrun_ticks"]["default"].as_u64()
            ),
            (&Value::Bool(false), Some(100))
        );
    }

    #[test]
    fn a_misspelt_key_is_not_in_the_schema() {
        let table: toml::Table = "[control]\nrate_herz = 3".parse().unwrap();
        let (schema, mut found) = (controller().unwrap(), Vec::new());
        unknown(&table, Node::root(&schema), "", &mut found);
        assert_eq!(found, ["control.rate_herz: not in the schema"]);
    }
}
