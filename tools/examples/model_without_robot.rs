//! Loads a model, moves its motors along a line and back, and converts counts to angles and back.
//! The angles of both passes differ by the hysteresis.
//!
//! `model_without_robot MODEL`
#![allow(clippy::print_stdout, reason = "an example")]

use std::error::Error;
use std::path::Path;

use i2ris::model::{Model, Query};

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(1).ok_or("usage: model_without_robot MODEL")?;
    let model = Model::load(Path::new(&file))?;
    let mut memory = model.new_memory();
    let centre = model.hull().centre();
    for offset in [-100, -50, 0, 50, 100, 50, 0, -50, -100] {
        let counts = centre.map(|count| count + f64::from(offset));
        model.advance(&mut memory, &counts);
        let pose = model.predict(&counts, &memory).mean;
        // Starts its search at the present counts.
        let inverse = model.invert(&pose, &memory, &Query::new(counts));
        let [pitch, yaw, ..] = pose.map(f64::to_degrees);
        println!("{counts:?} counts: {pitch:.3} and {yaw:.3} deg; back: {:?}", inverse.counts);
    }
    Ok(())
}
