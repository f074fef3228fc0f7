//! One list of the families of models, with samples and promises: the conformance suite of the
//! models, the cycle and others run with every row of it.
//!
//! To take a family out, remove its row here and its function in `rows`.

mod networks;
mod parameters;
mod rows;
mod samples;

use std::fmt;
use std::sync::Arc;

use i2ris::model::Model;
use i2ris::model::file::{FamilyParameters, ModelFile};
use proptest::strategy::BoxedStrategy;

pub use networks::*;
pub use parameters::*;
pub use samples::*;

/// Hands the list to a macro: a name, and the variant of [`FamilyParameters`].
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
        /// The samples of all rows.
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

/// A model that flies in the tests of the cycle, by name: its numbers can be worked out by hand, or
/// it is fitted.
pub type Flight = (&'static str, fn() -> Arc<Model>);

/// A family in the tests.
#[derive(Clone)]
pub struct Sample {
    pub name: &'static str,
    /// Two motors and two angles of the robot of the cycle, about as [`crate::cycle::model`].
    pub file: ModelFile,
    /// Motors and outputs of the random models.
    pub sizes: &'static [(usize, usize)],
    /// Random models of a size. A model that is refused is none.
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
    /// The model of [`Sample::file`].
    pub fn model(&self) -> Arc<Model> {
        Arc::new(Model::from_file(self.file.clone()).unwrap())
    }
}

/// What a family promises, in counts: an error of the outputs counts by what one count moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Promise {
    /// The prediction depends on past motion.
    pub has_memory: bool,
    /// Drift may scale gaps.
    pub has_gap: bool,
    /// A part of the compensation is possible; none gives the counts of a model without memory.
    pub compensates: bool,
    /// Outputs and counts of an inverse beside those that gave the goal. Where a motor is in a gap,
    /// other counts are as good: infinite.
    pub inverse: [f64; 2],
    /// A pose that is computed with its slope beside one that is computed alone, rad.
    pub shared: f64,
    /// The Jacobian beside differences, relative.
    pub slope: f64,
    /// Motion for a goal that is where the snake is, to a part of a thousandth of a count.
    pub stays: f64,
    /// After conditioning, what remains of the past.
    pub remains: f64,
    /// A prediction beside that after the motion of a tick.
    pub tick: f64,
    /// Motion in steps of another length.
    pub steps: f64,
    /// A memory that comes back from a history.
    pub recall: f64,
}

impl Promise {
    /// Of a family without memory.
    pub const EXACT: Self = Self {
        has_memory: false,
        has_gap: false,
        compensates: false,
        inverse: [0.05, 0.1],
        shared: 1e-12,
        slope: 1e-6,
        stays: 0.05,
        remains: 0.0,
        tick: 0.0,
        steps: 0.0,
        recall: 0.0,
    };
}
