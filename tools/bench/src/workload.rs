//! The queries of the control loop to a model over two seconds: goals on a circle of changing
//! radius, so that both motors turn often.

use std::f64::consts::{PI, TAU};

use i2ris::model::{Memory, Model, Query};
use i2ris::units::OutputVec;

/// Ticks of 1 ms.
pub const TICKS: usize = 2000;

/// The query of one tick.
#[derive(Debug, Clone, Copy)]
pub struct QueryTick {
    /// The memory before the motors moved.
    pub memory: Memory,
    /// The goal, rad.
    pub goal: OutputVec,
    /// Starts at the result of the tick before and contains the model's correction, as in the loop.
    pub query: Query,
}

/// The ticks. The memory has passed through the whole range before.
#[must_use]
pub fn workload(model: &Model) -> Vec<QueryTick> {
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
        let query = Query { correction: Some(model.correction(&memory)), ..Query::new(start) };
        let tick = QueryTick { memory, goal, query };
        start = model.invert(&goal, &memory, &query).counts;
        model.advance(&mut memory, &start);
        tick
    };
    (0..TICKS).map(tick).collect()
}
