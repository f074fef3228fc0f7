//! Checks and their results.

use std::fmt;

use serde::Serialize;

/// Result of a check: as expected; the robot works, but not as well as it could; the robot will not
/// work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Level {
    Ok,
    Warn,
    Fail,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
struct Check {
    /// Subject of the check.
    name: String,
    level: Level,
    found: String,
    /// Remedy; empty if none is needed.
    fix: String,
}

/// All checks, in order.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Report {
    checks: Vec<Check>,
    /// Tables to paste into the configuration.
    found_tables: Vec<String>,
}

impl Report {
    pub fn pass(&mut self, name: impl Into<String>, found: impl Into<String>) {
        self.add(Level::Ok, name.into(), found.into(), String::new());
    }

    pub fn warn(
        &mut self,
        name: impl Into<String>,
        found: impl Into<String>,
        fix: impl Into<String>,
    ) {
        self.add(Level::Warn, name.into(), found.into(), fix.into());
    }

    pub fn fail(
        &mut self,
        name: impl Into<String>,
        found: impl Into<String>,
        fix: impl Into<String>,
    ) {
        self.add(Level::Fail, name.into(), found.into(), fix.into());
    }

    fn add(&mut self, level: Level, name: String, found: String, fix: String) {
        self.checks.push(Check { name, level, found, fix });
    }

    /// Adds a table for the configuration.
    pub fn paste(&mut self, table: String) {
        self.found_tables.push(table);
    }

    pub fn failures(&self) -> usize {
        self.failed().count()
    }

    /// The names of what fails.
    pub fn failed(&self) -> impl Iterator<Item = &str> {
        let failed = self.checks.iter().filter(|check| check.level == Level::Fail);
        failed.map(|check| &*check.name)
    }

    /// First finding with its remedy, skipping those that contain `but`.
    #[cfg(test)]
    pub fn first(&self, but: &str) -> Option<[String; 2]> {
        let is_it = |check: &Check| !format!("{} {}", check.found, check.fix).contains(but);
        let of = |level| self.checks.iter().find(|it| it.level == level && is_it(it));
        let Check { name, found, fix, .. } = of(Level::Fail).or_else(|| of(Level::Warn))?;
        Some([format!("{name}: {found}"), fix.clone()])
    }

    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string_pretty(self)
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = self.checks.iter().map(|check| check.name.chars().count()).max().unwrap_or(0);
        for Check { name, level, found, fix } in &self.checks {
            let mark = match level {
                Level::Ok => "ok  ",
                Level::Warn => "WARN",
                Level::Fail => "FAIL",
            };
            write!(f, "{mark}  {name:width$}  {found}")?;
            if fix.is_empty() {
                writeln!(f)?
            } else {
                writeln!(f, "\n      {:width$}  -> {fix}", "")?
            }
        }
        self.found_tables.iter().try_for_each(|table| {
            write!(f, "\nfound, to paste into the configuration in place of this port:\n\n{table}")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_check_is_a_line_with_the_fix_below() {
        let mut report = Report::default();
        report.pass("memory", "locked");
        report.fail("port 0", "does not exist", "plug it in");
        assert_eq!(
            report.to_string(),
            "ok    memory  locked\nFAIL  port 0  does not exist\n              -> plug it in\n"
        );
        assert_eq!(report.failures(), 1);
        assert!(report.to_json().unwrap().contains("\"level\": \"fail\""));
    }
}
