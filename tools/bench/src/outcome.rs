//! What a measurement says.

use serde::Serialize;

use crate::machine::{Machine, Weather};
use crate::spans::Spans;

/// What a way is there for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// The least that this machine needs.
    Floor,
    /// What we made.
    Ours,
    /// What everybody has.
    Peer,
}

/// One way of doing a thing.
#[derive(Debug, Clone)]
pub struct Way {
    /// What it is called.
    pub name: String,
    /// Ways of one group are compared with the floor of the group, its first way with
    /// [`Role::Floor`].
    pub group: &'static str,
    /// What it is there for.
    pub role: Role,
    /// How long it took, again and again.
    pub spans: Spans,
}

/// Something that is a number and no distribution.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quantity {
    /// What it is called.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// In which unit.
    pub unit: &'static str,
}

impl Quantity {
    /// A number with its name and unit.
    #[must_use]
    pub fn new(name: impl Into<String>, value: f64, unit: &'static str) -> Self {
        Self {
            name: name.into(),
            value,
            unit,
        }
    }
}

/// Everything that one measurement says.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Which measurement: `ipc`, `loop`, `inverse`, `wire`, `e2e`.
    pub bench: &'static str,
    /// What it is about, in a sentence.
    pub about: &'static str,
    /// What it ran on.
    pub machine: Machine,
    /// What else the machine did meanwhile.
    pub weather: Weather,
    /// Where the threads ran.
    pub scheduling: Vec<String>,
    /// The ways, floors first within their group.
    pub ways: Vec<Way>,
    /// Beside them.
    pub quantities: Vec<Quantity>,
    /// What these numbers show, and what they do not.
    pub notes: Vec<String>,
}

/// Percentiles of a way as multiples of those of its floor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Ratio {
    /// Of the medians.
    pub p50: f64,
    /// Of the 99th percentiles.
    pub p99: f64,
}

impl Outcome {
    /// Groups in the order of their first way.
    #[must_use]
    pub fn groups(&self) -> Vec<&'static str> {
        let mut groups = Vec::new();
        for way in &self.ways {
            if !groups.contains(&way.group) {
                groups.push(way.group);
            }
        }
        groups
    }

    /// How a way compares with the floor of its group; `None` for the floor itself, and where there
    /// is none.
    #[must_use]
    pub fn ratio(&self, way: &Way) -> Option<Ratio> {
        let floor = self
            .ways
            .iter()
            .find(|other| other.group == way.group && other.role == Role::Floor)?;
        if way.role == Role::Floor || floor.spans.is_empty() || way.spans.is_empty() {
            return None;
        }
        let (own, least) = (way.spans.summary(), floor.spans.summary());
        let ratio = |own: u64, least: u64| own as f64 / least.max(1) as f64;
        Some(Ratio {
            p50: ratio(own.p50, least.p50),
            p99: ratio(own.p99, least.p99),
        })
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use i2ris::units::Nanos;

    use super::*;
    use crate::machine;

    pub(crate) fn way(name: &str, group: &'static str, role: Role, ns: u64) -> Way {
        let mut spans = Spans::new(0);
        (0..1000).for_each(|step| spans.push(Nanos(ns + step)));
        Way {
            name: name.to_owned(),
            group,
            role,
            spans,
        }
    }

    pub(crate) fn outcome(ways: Vec<Way>) -> Outcome {
        Outcome {
            bench: "ipc",
            about: "a test",
            machine: machine::look(),
            weather: machine::Watch::start().stop(),
            scheduling: vec!["sender: normal scheduling".to_owned()],
            ways,
            quantities: vec![Quantity::new("exchanges", 470.0, "1/s")],
            notes: vec!["<nothing>".to_owned()],
        }
    }

    #[test]
    fn a_way_is_compared_with_the_floor_of_its_own_group() {
        let ways = vec![
            way("least", "polled", Role::Floor, 10_000),
            way("ours", "polled", Role::Ours, 30_000),
            way("wait", "waiting", Role::Floor, 100_000),
            way("socket", "waiting", Role::Peer, 200_000),
            way("alone", "other", Role::Ours, 5),
        ];
        let outcome = outcome(ways);
        let p50 = |index: usize| outcome.ratio(&outcome.ways[index]).map(|ratio| ratio.p50);
        assert_eq!((p50(0), p50(2), p50(4)), (None, None, None));
        assert!((p50(1).unwrap() - 30_500.0 / 10_500.0).abs() < 0.01);
        assert!((p50(3).unwrap() - 200_500.0 / 100_500.0).abs() < 0.01);
        assert_eq!(outcome.groups(), ["polled", "waiting", "other"]);
    }
}
