//! The list of model families, with samples and promises: conformance suites run with each row.
//!
//! To delete a family, remove its row here and its function in `rows`.

mod parameters;
mod rows;
mod samples;

use std::fmt;
use std::sync::Arc;

use i2ris::model::Model;
use i2ris::model::file::{FamilyParameters, ModelFile};
use proptest::strategy::BoxedStrategy;

pub use parameters::*;
pub use samples::*;

/// Passes the list to a macro: a name, and the variant of [`FamilyParameters`].
#[macro_export]
macro_rules! for_each_family {
    ($then:ident) => {
        $then! {
            linear = Linear;
            gmr = Gmr;
            gmr_play = GmrPlay;
            force_balance = ForceBalance;
            network = Network;
        }
    };
}

macro_rules! list {
    ($($row:ident = $family:ident;)*) => {
        pub fn all() -> Vec<Sample> {
            vec![$($row()),*]
        }

        $(
            pub fn $row() -> Sample {
                Sample { name: stringify!($row), ..rows::$row() }
            }
        )*

        /// The row of a family. A family without a row does not compile.
        pub fn row_of(family: &FamilyParameters) -> &'static str {
            match family {
                $(FamilyParameters::$family { .. } => stringify!($row),)*
            }
        }
    };
}
for_each_family!(list);

/// A model used in the cycle tests, by name: it can be computed by hand, or it is fitted.
pub type Flight = (&'static str, fn() -> Arc<Model>);

#[derive(Clone)]
pub struct Sample {
    pub name: &'static str,
    /// Two motors and two angles of the cycle's robot, similar to [`crate::cycle::model`].
    pub file: ModelFile,
    /// Motors and outputs of the random models.
    pub sizes: &'static [(usize, usize)],
    /// Random models of a size. A refused model is `None`.
    pub random: fn(usize, usize) -> BoxedStrategy<ModelFile>,
    pub promise: Promise,
    pub flies: &'static [Flight],
}

impl fmt::Debug for Sample {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl Sample {
    pub fn model(&self) -> Arc<Model> {
        Arc::new(Model::from_file(self.file.clone()).unwrap())
    }
}

/// Promises of a family, in counts: output errors are divided by the effect of one count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Promise {
    /// The prediction depends on past motion.
    pub has_memory: bool,
    /// Drift may scale gaps.
    pub has_gap: bool,
    /// A part of the compensation is possible; none gives the counts of a model without memory.
    pub compensates: bool,
    /// Error of outputs and counts of an inverse; infinite where a gap makes other counts as good.
    pub inverse: [f64; 2],
    /// Further error of outputs where a motor stays: it crosses no gap for half a count.
    pub rounding: f64,
    /// Difference between a pose computed with its slope and one computed alone, rad.
    pub shared: f64,
    /// Relative difference between Jacobian and finite differences.
    pub slope: f64,
    /// Motion for a goal at the present pose, resolved to less than a thousandth of a count.
    pub stays: f64,
    /// Remaining effect of the past after conditioning.
    pub remains: f64,
    /// Difference between a prediction and that after the motion of a tick.
    pub tick: f64,
    /// Motion in steps of another length.
    pub steps: f64,
    /// Error of a memory restored from a history.
    pub recall: f64,
}

impl Promise {
    pub const EXACT: Self = Self {
        has_memory: false,
        has_gap: false,
        compensates: false,
        inverse: [0.05, 0.1],
        rounding: 0.0,
        shared: 1e-12,
        slope: 1e-6,
        stays: 0.05,
        remains: 0.0,
        tick: 0.0,
        steps: 0.0,
        recall: 0.0,
    };
}
