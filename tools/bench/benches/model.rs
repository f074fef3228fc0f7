//! Time of one call of a model, and of one climb of EM; see the crate's documentation.
#![allow(missing_docs, clippy::unwrap_used)]

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use i2ris::model::Model;
use i2ris_bench::model::{REACH, model};
use i2ris_bench::way::{Tick, way};
use i2ris_bench::{COMPONENTS, PLAYS};
use i2ris_calibration::em::{EmOptions, fit_mixture};
use i2ris_calibration::progress::Silent;
use i2ris_calibration::table::DataTable;

/// Measures a call at one tick after the other.
fn each<T>(
    criterion: &mut Criterion,
    group: &str,
    components: usize,
    plays: usize,
    call: impl Fn(&Model, &Tick) -> T,
) {
    let model = model(components, plays).unwrap();
    let ticks = way(&model);
    let mut next = ticks.iter().cycle();
    let id = BenchmarkId::from_parameter(format!("K{components}/plays{plays}"));
    let mut group = criterion.benchmark_group(group);
    group.bench_function(id, |bencher| {
        bencher.iter(|| call(&model, black_box(next.next().unwrap())))
    });
}

fn calls(criterion: &mut Criterion) {
    for components in COMPONENTS {
        for plays in PLAYS {
            each(criterion, "inverse", components, plays, |m, tick| {
                m.invert(&tick.goal, &tick.memory, &tick.query)
            });
            each(criterion, "forward", components, plays, |m, tick| {
                m.predict(&tick.query.start, &tick.memory)
            });
        }
    }
    for plays in PLAYS {
        each(criterion, "correction", 10, plays, |m, tick| {
            m.correction(&tick.memory)
        });
        each(criterion, "advance", 10, plays, |m, tick| {
            let mut memory = tick.memory;
            m.advance(&mut memory, &tick.query.start);
            memory
        });
    }
}

/// Motion over the plane with many turns, and the bend of a smooth map.
fn rows() -> DataTable {
    let at = |row: usize| {
        let t = row as f64 * 0.1;
        let a = REACH * (0.6 * (0.31 * t).sin() + 0.4 * (1.13 * t).sin());
        let b = REACH * (0.6 * (0.23 * t).cos() + 0.4 * (0.97 * t).sin());
        let noise = |frequency: f64| 0.1 * (frequency * t * t).sin();
        [
            a,
            b,
            20.0 * ((a - b) / 1500.0).tanh() + noise(7.7),
            20.0 * ((a + b) / 1500.0).tanh() + noise(9.1),
        ]
    };
    DataTable::from_rows(4, (0..10_000).map(at))
}

fn fits(criterion: &mut Criterion) {
    let rows = rows();
    let mut group = criterion.benchmark_group("fit");
    group.sample_size(10);
    for components in COMPONENTS {
        let options = EmOptions {
            restarts: 1,
            ..EmOptions::default()
        };
        group.bench_function(format!("10000 rows/K{components}/1 start"), |bencher| {
            bencher.iter(|| fit_mixture(&rows, components, &options, &Silent).unwrap());
        });
    }
    group.finish();
}

criterion_group!(benches, calls, fits);
criterion_main!(benches);
