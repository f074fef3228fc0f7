//! The outcome of a measurement.

use serde::Serialize;

use crate::durations::Durations;
use crate::machine::{Machine, SystemLoad};

/// The purpose of a variant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// The least that this machine needs.
    Floor,
    /// Software of this repository.
    Ours,
    /// A common alternative.
    Peer,
}

/// One implementation of the measured task.
#[derive(Debug, Clone)]
pub struct Variant {
    /// Its name.
    pub name: String,
    /// Variants of one group are compared with the first floor of the group.
    pub group: String,
    /// Its purpose.
    pub role: Role,
    /// Its durations.
    pub durations: Durations,
}

impl Variant {
    /// A variant with its durations.
    #[must_use]
    pub fn new(name: &str, group: impl Into<String>, role: Role, durations: Durations) -> Self {
        Self { name: name.to_owned(), group: group.into(), role, durations }
    }

    /// Its name, with a remark if it is the floor.
    #[must_use]
    pub fn display_name(&self) -> String {
        let remark = if self.role == Role::Floor { " (floor)" } else { "" };
        format!("{}{remark}", self.name)
    }
}

/// A number that is not a distribution.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quantity {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its unit.
    pub unit: &'static str,
}

impl Quantity {
    /// A number with its name and unit.
    #[must_use]
    pub fn new(name: impl Into<String>, value: f64, unit: &'static str) -> Self {
        Self { name: name.into(), value, unit }
    }
}

/// The outcome of one measurement.
#[derive(Debug, Clone)]
pub struct BenchOutcome {
    /// The measurement: `ipc`, `loop`, `inverse`, `wire`, `e2e`.
    pub bench: &'static str,
    /// Its description.
    pub about: &'static str,
    /// The machine.
    pub machine: Machine,
    /// The load of the machine during the measurement.
    pub load: SystemLoad,
    /// Scheduling and processors of the threads.
    pub scheduling: Vec<String>,
    /// The variants, floors first within their group.
    pub variants: Vec<Variant>,
    /// Further numbers.
    pub quantities: Vec<Quantity>,
    /// What these numbers show, and what they do not show.
    pub notes: Vec<String>,
}

/// Percentiles of a variant as multiples of those of its floor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Ratio {
    /// Of the medians.
    pub p50: f64,
    /// Of the 99th percentiles.
    pub p99: f64,
}

impl BenchOutcome {
    /// The groups with their variants, in the order of their first variant.
    #[must_use]
    pub fn groups(&self) -> Vec<(&str, Vec<&Variant>)> {
        let mut groups: Vec<(&str, Vec<&Variant>)> = Vec::new();
        for variant in &self.variants {
            match groups.iter_mut().find(|(name, _)| *name == variant.group) {
                Some((_, variants)) => variants.push(variant),
                None => groups.push((&variant.group, vec![variant])),
            }
        }
        groups
    }

    /// The ratio of a variant to the floor of its group; `None` for a floor and without a floor.
    #[must_use]
    pub fn ratio(&self, variant: &Variant) -> Option<Ratio> {
        let is_floor = |other: &&Variant| other.group == variant.group && other.role == Role::Floor;
        let floor = self.variants.iter().find(is_floor)?;
        let is_empty = floor.durations.is_empty() || variant.durations.is_empty();
        if variant.role == Role::Floor || is_empty {
            return None;
        }
        let (own, least) = (variant.durations.percentiles(), floor.durations.percentiles());
        let ratio = |own: u64, least: u64| own as f64 / least.max(1) as f64;
        Some(Ratio { p50: ratio(own.p50, least.p50), p99: ratio(own.p99, least.p99) })
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use i2ris::units::Nanos;

    use super::*;
    use crate::machine::LoadMonitor;

    pub(crate) fn variant(name: &str, group: &'static str, role: Role, ns: u64) -> Variant {
        let mut durations = Durations::new(0);
        for step in 0..1000 {
            durations.push(Nanos(ns + step));
        }
        Variant::new(name, group, role, durations)
    }

    pub(crate) fn outcome(variants: Vec<Variant>) -> BenchOutcome {
        BenchOutcome {
            bench: "ipc",
            about: "a test",
            machine: Machine::detect(),
            load: LoadMonitor::start().stop(),
            scheduling: vec!["sender: normal scheduling".to_owned()],
            variants,
            quantities: vec![Quantity::new("exchanges", 470.0, "1/s")],
            notes: vec!["<nothing>".to_owned()],
        }
    }

    #[test]
    fn a_variant_is_compared_with_the_floor_of_its_own_group() {
        let outcome = outcome(vec![
            variant("least", "polled", Role::Floor, 10_000),
            variant("ours", "polled", Role::Ours, 30_000),
            variant("wait", "waiting", Role::Floor, 100_000),
            variant("socket", "waiting", Role::Peer, 200_000),
            variant("alone", "other", Role::Ours, 5),
        ]);
        let p50 = |index: usize| outcome.ratio(&outcome.variants[index]).map(|ratio| ratio.p50);
        assert_eq!((p50(0), p50(2), p50(4)), (None, None, None));
        assert!((p50(1).unwrap() - 30_500.0 / 10_500.0).abs() < 0.01);
        assert!((p50(3).unwrap() - 200_500.0 / 100_500.0).abs() < 0.01);
        let groups = outcome.groups();
        let names: Vec<_> = groups.iter().map(|(name, variants)| (*name, variants.len())).collect();
        assert_eq!(names, [("polled", 2), ("waiting", 2), ("other", 1)]);
    }
}
