//! A random model of a family, somewhere in its hull after some motion.

use std::sync::Arc;

use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed, TestRunner};

use super::*;

#[derive(Debug, Clone)]
pub struct Situation {
    pub name: &'static str,
    pub model: Arc<Model>,
    pub promise: Promise,
    /// Turning points, the last of them where the motors are, and others.
    pub path: Vec<MotorVec>,
    pub other: Vec<MotorVec>,
    /// After the motion, in steps of a tick.
    pub memory: Memory,
    pub at: MotorVec,
    pub start: MotorVec,
    /// Between 0 and 1.
    pub part: f64,
    /// Any numbers, including NaN.
    pub wild: [f64; 5],
    /// Average motion per count, rad (m).
    pub worth: f64,
}

/// Tries a case with random models of every size of a family.
pub fn each(sample: &Sample, case: fn(&Situation)) {
    for (motors, outputs) in sample.sizes {
        let config = i2ris_testing::cases(8);
        // The gate tries the same models each time; the nightly run tries others.
        let is_gate = std::env::var("PROPTEST_CASES").is_err();
        let rng_seed = if is_gate { RngSeed::Fixed(4) } else { RngSeed::Random };
        let config =
            Config { source_file: Some(file!()), max_shrink_iters: 60, rng_seed, ..config };
        let result = TestRunner::new(config).run(&situations(sample, *motors, *outputs), |it| {
            case(&it);
            Ok(())
        });
        result.unwrap_or_else(|error| panic!("{motors} x {outputs}: {error}"));
    }
}

fn situations(sample: &Sample, motors: usize, outputs: usize) -> impl Strategy<Value = Situation> {
    let models = (sample.random)(motors, outputs);
    let models =
        models.prop_filter_map("is refused", |file| Model::from_file(file).ok().map(Arc::new));
    let part = || (-1.0..1.0_f64, -1.0..1.0_f64).prop_map(|(a, b)| [a, b]);
    let paths = (vec(part(), 1..8), vec(part(), 1..8));
    let numbers =
        (0.0..1.0_f64, [any_number(), any_number(), any_number(), any_number(), any_number()]);
    let (name, promise) = (sample.name, sample.promise);
    (models, paths, part(), part(), numbers).prop_map(
        move |(model, (path, other), at, start, (part, wild))| {
            let reach = reach(&model);
            let within = |part: MotorVec| [0, 1].map(|motor: usize| part[motor] * reach[motor]);
            let path: Vec<MotorVec> = path.into_iter().map(within).collect();
            Situation {
                memory: memory_after(&model, &in_steps(&path, 10.0)),
                other: other.into_iter().map(within).collect(),
                at: within(at),
                start: within(start),
                worth: worth(&model),
                name,
                model,
                promise,
                path,
                part,
                wild,
            }
        },
    )
}

impl Situation {
    pub fn present(&self) -> MotorVec {
        self.path[self.path.len() - 1]
    }

    pub fn mean(&self, counts: &MotorVec, memory: &Memory) -> OutputVec {
        self.model.predict(counts, memory).mean
    }

    /// The same without the residual of a family with gaps, which holds still in an inverse.
    pub fn pose(&self, counts: &MotorVec, memory: &Memory) -> OutputVec {
        if self.promise.has_gap {
            self.model.pose(counts, memory, &[0.0; 3])
        } else {
            self.mean(counts, memory)
        }
    }

    /// Promised output error of an inverse, counts.
    pub fn may_miss(&self, found: &MotorVec) -> f64 {
        let present = self.present();
        let stays = (0..self.model.motors()).any(|it| (found[it] - present[it]).abs() < 1e-6);
        self.promise.inverse[0] + self.promise.rounding * f64::from(stays)
    }

    /// The memory after motion in steps.
    pub fn after(&self, path: &[MotorVec]) -> Memory {
        memory_after(&self.model, &in_steps(path, 10.0))
    }

    /// Asserts that an error is within the promise, up to rounding.
    #[track_caller]
    pub fn assert_within(&self, what: &str, error: f64, promised: f64) {
        assert!(error <= promised + 1e-9, "{}, {what}: {error}, promised {promised}", self.name);
    }

    /// Asserts that predictions with two memories differ by at most `promised` counts.
    #[track_caller]
    pub fn assert_alike(&self, what: &str, one: &Memory, other: &Memory, promised: f64) {
        for at in [self.at, self.start, self.present(), [0.0; 2]] {
            let [one, other] = [one, other].map(|memory| self.mean(&at, memory));
            self.assert_within(what, distance(&one, &other) / self.worth, promised);
        }
    }
}

/// Half the width of the hull.
pub fn reach(model: &Model) -> MotorVec {
    [0, 1].map(|motor: usize| model.hull().corners().map(|at| at[motor]).fold(0.0, f64::max))
}

/// Average motion per count of the motor with more effect, over the hull.
fn worth(model: &Model) -> f64 {
    let reach = reach(model);
    let memory = memory_after(model, &[[0.0; 2]]);
    let of = |motor: usize| {
        let ends = [-1.0, 1.0].map(|side| {
            let mut at = [0.0; 2];
            at[motor] = side * reach[motor];
            model.predict(&at, &memory).mean
        });
        distance(&ends[0], &ends[1]) / (2.0 * reach[motor])
    };
    (0..model.motors()).map(of).fold(0.0, f64::max)
}

/// Straight motion from point to point, in steps of at most `step` counts.
pub fn in_steps(path: &[MotorVec], step: f64) -> Vec<MotorVec> {
    let between = path.windows(2).flat_map(|pair| {
        let way = [0, 1].map(|motor: usize| pair[1][motor] - pair[0][motor]);
        let count = (way[0].abs().max(way[1].abs()) / step).ceil().max(1.0) as u32;
        (1..=count).map(move |number| {
            let part = f64::from(number) / f64::from(count);
            let between = [0, 1].map(|motor: usize| pair[0][motor] + part * way[motor]);
            if number == count { pair[1] } else { between }
        })
    });
    path.iter().take(1).copied().chain(between).collect()
}
