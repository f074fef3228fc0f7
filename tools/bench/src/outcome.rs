//! The outcome of a measurement: variants with their histograms, and further numbers.

use hdrhistogram::Histogram;
use i2ris::units::Nanos;
use serde::Serialize;

use crate::Failure;
use crate::machine::{LoadMonitor, Machine, SystemLoad};

/// Maximum duration: a longer one is counted as one minute.
const MAX_DURATION_NS: u64 = 60_000_000_000;
const DIGITS: u8 = 3;

/// A histogram of durations. It ignores the first ones, in which caches and clocks warm up.
#[derive(Debug, Clone)]
pub struct Durations {
    pub histogram: Histogram<u64>,
    warm_up: u64,
}

/// Percentiles, ns.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Percentiles {
    pub count: u64,
    pub p50: u64,
    pub p90: u64,
    pub p99: u64,
    pub p999: u64,
    pub max: u64,
}

impl Durations {
    #[allow(clippy::expect_used, reason = "the bounds are valid constants; a test makes one")]
    pub fn new(warm_up: u64) -> Self {
        let histogram =
            Histogram::new_with_bounds(1, MAX_DURATION_NS, DIGITS).expect("constant bounds");
        Self { histogram, warm_up }
    }

    pub fn push(&mut self, duration: Nanos) {
        match self.warm_up {
            0 => self.histogram.saturating_record(duration.0.max(1)),
            _ => self.warm_up -= 1,
        }
    }

    pub fn add(&mut self, other: &Self) {
        // Only a histogram with a wider range is refused, and all have the same range.
        let _ = self.histogram.add(&other.histogram);
    }

    pub fn is_empty(&self) -> bool {
        self.histogram.is_empty()
    }

    pub fn percentiles(&self) -> Percentiles {
        let quantile = |share| self.histogram.value_at_quantile(share);
        Percentiles {
            count: self.histogram.len(),
            p50: quantile(0.5),
            p90: quantile(0.9),
            p99: quantile(0.99),
            p999: quantile(0.999),
            max: self.histogram.max(),
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// The minimum of this machine.
    Floor,
    /// Software of this repository.
    Ours,
    /// A common alternative.
    Peer,
}

/// One implementation of the measured task.
#[derive(Debug, Clone, Serialize)]
pub struct Variant {
    pub name: String,
    /// Variants of one group are compared with the first floor of the group.
    pub group: String,
    pub role: Role,
    #[serde(rename = "spans_ns")]
    pub percentiles: Percentiles,
    /// `None` for a floor, if there is no floor, and without durations.
    pub x_floor: Option<Ratio>,
    #[serde(skip)]
    pub durations: Durations,
}

/// Percentiles as multiples of the floor's percentiles.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Ratio {
    pub p50: f64,
    pub p99: f64,
}

impl Variant {
    pub fn new(name: &str, group: &str, role: Role, durations: Durations) -> Self {
        Self {
            name: name.to_owned(),
            group: group.to_owned(),
            role,
            percentiles: durations.percentiles(),
            x_floor: None,
            durations,
        }
    }

    /// Its name, with a remark if it is the floor.
    pub fn display_name(&self) -> String {
        let remark = if self.role == Role::Floor { " (floor)" } else { "" };
        format!("{}{remark}", self.name)
    }
}

/// A number that is not a distribution.
#[derive(Debug, Clone, Serialize)]
pub struct Quantity {
    pub name: String,
    pub value: f64,
    pub unit: &'static str,
}

impl Quantity {
    pub fn new(name: impl Into<String>, value: f64, unit: &'static str) -> Self {
        Self { name: name.into(), value, unit }
    }
}

/// Results of a measurement.
#[derive(Debug, Default)]
pub struct Found {
    /// Scheduling and processors of the threads.
    pub scheduling: Vec<String>,
    pub variants: Vec<Variant>,
    pub quantities: Vec<Quantity>,
    /// Notes on the validity of these numbers.
    pub notes: Vec<String>,
}

/// Results of a measurement, and the machine.
#[derive(Debug, Clone, Serialize)]
pub struct Outcome {
    /// The measurement: `ipc`, `loop`, `inverse`, `wire`, `e2e`, `hand`.
    pub bench: &'static str,
    pub about: &'static str,
    pub machine: Machine,
    #[serde(rename = "weather")]
    pub load: SystemLoad,
    pub scheduling: Vec<String>,
    pub variants: Vec<Variant>,
    pub quantities: Vec<Quantity>,
    pub notes: Vec<String>,
}

impl Outcome {
    /// Measures, and compares every variant with its floor.
    pub fn of(
        bench: &'static str,
        about: &'static str,
        measure: impl FnOnce() -> Result<Found, Failure>,
    ) -> Result<Self, Failure> {
        let monitor = LoadMonitor::start();
        let Found { scheduling, mut variants, quantities, mut notes } = measure()?;
        let machine = Machine::detect();
        notes.extend(machine.notes());
        compare_with_floors(&mut variants);
        let load = monitor.stop();
        Ok(Self { bench, about, machine, load, scheduling, variants, quantities, notes })
    }

    /// The groups with their variants, in the order of their first variant.
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
}

fn compare_with_floors(variants: &mut [Variant]) {
    let is_floor = |variant: &&Variant| variant.role == Role::Floor;
    let floors: Vec<Variant> = variants.iter().filter(is_floor).cloned().collect();
    for variant in variants.iter_mut().filter(|variant| variant.role != Role::Floor) {
        let floor = floors.iter().find(|floor| floor.group == variant.group);
        let (Some(floor), false) = (floor, variant.durations.is_empty()) else { continue };
        let ratio = |own: u64, least: u64| own as f64 / least.max(1) as f64;
        let (own, least) = (variant.percentiles, floor.percentiles);
        variant.x_floor = (!floor.durations.is_empty())
            .then(|| Ratio { p50: ratio(own.p50, least.p50), p99: ratio(own.p99, least.p99) });
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;

    pub fn variant(name: &str, group: &str, role: Role, ns: u64) -> Variant {
        let mut durations = Durations::new(0);
        for step in 0..1000 {
            durations.push(Nanos(ns + step));
        }
        Variant::new(name, group, role, durations)
    }

    pub fn outcome(variants: Vec<Variant>) -> Outcome {
        let found = Found {
            scheduling: vec!["sender: normal scheduling".to_owned()],
            variants,
            quantities: vec![Quantity::new("exchanges", 470.0, "1/s")],
            notes: vec!["<nothing>".to_owned()],
        };
        Outcome::of("loop", "a test", || Ok(found)).unwrap()
    }

    #[test]
    fn warm_up_is_ignored_and_long_durations_are_limited() {
        let mut durations = Durations::new(10);
        let first = std::iter::repeat_n(1_000_000_000, 10);
        for ns in first.chain(1..=1000) {
            durations.push(Nanos(ns));
        }
        let found = durations.percentiles();
        assert_eq!((found.count, found.p50, found.max), (1000, 500, 1000));
        assert!((989..=991).contains(&found.p99), "{found:?}");
        let mut all = Durations::new(0);
        assert!(all.is_empty());
        all.add(&durations);
        durations.push(Nanos(u64::MAX));
        all.add(&durations);
        let Percentiles { count, max, .. } = all.percentiles();
        assert!(count == 2001 && max <= MAX_DURATION_NS + MAX_DURATION_NS / 1000, "{max}");
    }

    #[test]
    fn a_variant_is_compared_with_its_own_floor() {
        let outcome = outcome(vec![
            variant("least", "polled", Role::Floor, 10_000),
            variant("ours", "polled", Role::Ours, 30_000),
            variant("wait", "waiting", Role::Floor, 100_000),
            variant("socket", "waiting", Role::Peer, 200_000),
            variant("alone", "other", Role::Ours, 5),
        ]);
        let p50 = |index: usize| outcome.variants[index].x_floor.map(|ratio| ratio.p50);
        assert_eq!((p50(0), p50(2), p50(4)), (None, None, None));
        assert!((p50(1).unwrap() - 30_500.0 / 10_500.0).abs() < 0.01);
        assert!((p50(3).unwrap() - 200_500.0 / 100_500.0).abs() < 0.01);
        let groups = outcome.groups();
        let names: Vec<_> = groups.iter().map(|(name, variants)| (*name, variants.len())).collect();
        assert_eq!(names, [("polled", 2), ("waiting", 2), ("other", 1)]);
    }
}
