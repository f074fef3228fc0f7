//! What a control loop asks of a model over two seconds: goals on a circle that breathes, so both
//! motors turn often.

use std::f64::consts::{PI, TAU};

use i2ris::model::{Memory, Model, Query};
use i2ris::units::OutputVec;

/// Ticks of 1 ms.
pub const TICKS: usize = 2000;

/// One tick: what is known, and what is asked.
#[derive(Debug, Clone, Copy)]
pub struct Tick {
    /// Before the motors moved.
    pub memory: Memory,
    /// The goal, rad.
    pub goal: OutputVec,
    /// From the answer of the tick before, with the model's correction given, as the loop does
    /// after filtering it.
    pub query: Query,
}

/// The ticks, with a memory that has seen the whole range.
#[must_use]
pub fn way(model: &Model) -> Vec<Tick> {
    let mut memory = model.new_memory();
    for corner in model.hull().corners() {
        model.advance(&mut memory, &corner);
    }
    let mut start = model.hull().centre();
    model.advance(&mut memory, &start);
    let tick = |number: usize| {
        let turn = TAU * number as f64 / TICKS as f64;
        let radius = (12.0 + 4.0 * (7.0 * turn).sin()) * PI / 180.0;
        let goal = [radius * turn.cos(), radius * turn.sin(), 0.0];
        let query = Query {
            correction: Some(model.correction(&memory)),
            ..Query::new(start)
        };
        let tick = Tick {
            memory,
            goal,
            query,
        };
        start = model.invert(&goal, &memory, &query).counts;
        model.advance(&mut memory, &start);
        tick
    };
    (0..TICKS).map(tick).collect()
}
