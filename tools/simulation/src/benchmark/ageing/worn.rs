//! How snakes age here.

use std::f64::consts::TAU;

use crate::ageing::{Change, Course, Parameter};

/// Growth of gaps and friction, loss of preload, of a snake that has been used.
const WORN: [(Parameter, f64); 3] =
    [(Parameter::Gap, 0.4), (Parameter::Preload, -0.3), (Parameter::Friction, 0.25)];

/// The direction in which the zero slips and drifts: neither axis, and no motor.
const DIRECTION: [f64; 2] = [0.83, -0.55];

fn change(parameter: Parameter, by: f64, course: Course) -> Change {
    Change {
        parameter,
        by,
        start_s: 0.0,
        motor: None,
        direction: (parameter == Parameter::Zero).then_some(DIRECTION),
        course,
    }
}

/// At once.
pub fn worn() -> Vec<Change> {
    let of = |(parameter, by): (Parameter, f64)| change(parameter, by, Course::Step {});
    WORN.into_iter().map(of).collect()
}

/// The same, and a zero that moves by a degree, little by little.
pub fn wearing(over_s: f64) -> Vec<Change> {
    let zero = (Parameter::Zero, 1.0);
    let of = |(parameter, by): (Parameter, f64)| change(parameter, by, Course::Ramp { over_s });
    WORN.into_iter().chain([zero]).map(of).collect()
}

/// The zero slips by a degree.
pub fn slip() -> Change {
    change(Parameter::Zero, 1.0, Course::Step {})
}

/// Hours of use: the temperature of the room moves zero and gain, the zero wanders, gaps grow.
pub fn drifting(hours: f64) -> Vec<Change> {
    let hour = 3600.0;
    let slow = |period_s: f64| Course::Oscillation { period_s };
    vec![
        change(Parameter::Zero, 0.5, slow(2.0 * hour)),
        change(Parameter::Zero, 0.3, Course::RandomWalk { over_s: hour }),
        change(Parameter::Gain, 0.03, slow(TAU * hour)),
        change(Parameter::Gap, 0.2, Course::Ramp { over_s: hours * hour }),
    ]
}
