//! The parameters of stop operators as a vector of numbers without bounds.
//!
//! Lengths, forces and stiffnesses are positive and differ by orders of magnitude, so the search
//! works on their logarithms.

use i2ris::model::hysteresis::stop::{
    LEAST, StopAxis, StopElement, StopMotor, StopParameters, StopSegment,
};
use nalgebra::DVector;

/// Logarithms stay between these: 1e-6 to 3000.
const LOGARITHMS: (f64, f64) = (-14.0, 8.0);

/// The least stiffness of a spring.
const LEAST_STIFFNESS: f64 = 1e-6;

/// The parameterisation around the parameters that a search starts from.
#[derive(Debug, Clone)]
pub(super) struct Parameterisation {
    motors: usize,
    segments: usize,
    stops: usize,
    /// Neutral counts and travel per count of the start: both are coded relative to them.
    neutral: Vec<(f64, f64)>,
}

impl Parameterisation {
    pub fn new(start: &StopParameters) -> Self {
        let motors = start.motors.iter();
        Self {
            motors: start.motors.len(),
            segments: start.segments.len(),
            stops: start.stops.len(),
            neutral: motors.map(|m| (m.neutral_counts, m.travel_per_count)).collect(),
        }
    }

    pub fn encode(&self, parameters: &StopParameters) -> DVector<f64> {
        let mut code = Vec::new();
        for (motor, (neutral, travel)) in parameters.motors.iter().zip(&self.neutral) {
            code.extend([
                (motor.travel_per_count / travel).ln(),
                (motor.neutral_counts - neutral) * travel,
            ]);
            code.extend(motor.slack.iter().chain(&motor.friction).map(|x| x.ln()));
        }
        if self.motors == 2 {
            code.extend(parameters.motors.iter().map(|motor| motor.axis_deg.to_radians()));
            code.push((parameters.shared / (1.0 - parameters.shared)).ln());
        }
        code.extend(springs(parameters).into_iter().flatten().map(f64::ln));
        let friction = parameters.segments.iter().map(|segment| segment.friction);
        code.extend(relative_to_first(friction));
        let (softness, loose) = (parameters.softness, parameters.loose_stiffness);
        let (base, growth) = (parameters.base_friction, parameters.friction_growth);
        code.extend([softness, loose, base, growth].map(f64::ln));
        code.extend(parameters.stops.iter().map(|stop| stop.stiffness.ln()));
        code.extend(relative_to_first(parameters.stops.iter().map(|stop| stop.share)));
        DVector::from_vec(code)
    }

    /// Always parameters within their bounds; only the directions of the motors may fall together.
    pub fn decode(&self, code: &DVector<f64>) -> StopParameters {
        let mut code = Reader(code.as_slice().iter());
        let motors = self.neutral.iter().map(|neutral| motor(&mut code, *neutral));
        let mut motors: Vec<StopMotor> = motors.collect();
        let mut shared = 0.0;
        if self.motors == 2 {
            for motor in &mut motors {
                motor.axis_deg = code.plain().to_degrees() % 360.0;
            }
            shared = 1.0 / (1.0 + (-code.plain()).exp());
        }
        let segments = self.segments(&mut code);
        let softness = code.positive().max(LEAST);
        let loose_stiffness = code.positive().clamp(LEAST, 1.0);
        let base_friction = code.positive();
        let friction_growth = code.positive().min(1.0);
        let stiffnesses: Vec<f64> = (0..self.stops).map(|_| code.positive().max(1e-4)).collect();
        let shares = code.after_first(self.stops);
        let sum: f64 = shares.iter().sum();
        let stop = |(stiffness, share): (f64, f64)| StopElement { stiffness, share: share / sum };
        let stops = stiffnesses.into_iter().zip(shares).map(stop).collect();
        StopParameters {
            motors,
            segments,
            softness,
            loose_stiffness,
            base_friction,
            friction_growth,
            shared,
            stops,
        }
    }

    fn segments(&self, code: &mut Reader) -> Vec<StopSegment> {
        let springs: Vec<[f64; 3]> = (0..self.segments).map(|_| code.three()).collect();
        let others: Vec<[f64; 3]> = (1..self.motors).map(|_| code.three()).collect();
        let friction = code.after_first(self.segments);
        let mean = friction.iter().sum::<f64>() / friction.len().max(1) as f64;
        let axes = |spring: &[f64; 3]| {
            let axis = |ratio: &[f64; 3]| StopAxis {
                stiffness: (spring[0] * ratio[0]).max(LEAST_STIFFNESS),
                stiffening: spring[1] * ratio[1],
                limit: (spring[2] * ratio[2]).max(LEAST),
            };
            std::iter::once(&[1.0; 3]).chain(&others).map(axis).collect()
        };
        let segment = |(spring, friction): (&[f64; 3], f64)| StopSegment {
            axes: axes(spring),
            friction: (friction / mean).max(LEAST),
        };
        springs.iter().zip(friction).map(segment).collect()
    }
}

/// Springs of the segments along the first axis, and then, relative to them and for all segments
/// alike, along the other.
fn springs(parameters: &StopParameters) -> Vec<[f64; 3]> {
    let numbers = |axis: &StopAxis| [axis.stiffness, axis.stiffening, axis.limit];
    let first = |segment: &StopSegment| segment.axes.first().map(numbers);
    let mut springs: Vec<[f64; 3]> = parameters.segments.iter().filter_map(first).collect();
    let axes = parameters.segments.first().map(|segment| segment.axes.as_slice());
    if let Some([one, other]) = axes {
        let (one, other) = (numbers(one), numbers(other));
        springs.push(std::array::from_fn(|i| other[i] / one[i]));
    }
    springs
}

/// Logarithms of all but the first value, relative to the first one.
fn relative_to_first(mut values: impl Iterator<Item = f64>) -> impl Iterator<Item = f64> {
    let first = values.next().unwrap_or(1.0);
    values.map(move |value| (value / first).ln())
}

fn motor(code: &mut Reader, (neutral, travel): (f64, f64)) -> StopMotor {
    StopMotor {
        travel_per_count: travel * code.positive(),
        neutral_counts: neutral + code.plain() / travel,
        axis_deg: 0.0,
        slack: [code.positive(), code.positive()],
        friction: [code.positive().min(1.0), code.positive().min(1.0)],
    }
}

struct Reader<'a>(std::slice::Iter<'a, f64>);

impl Reader<'_> {
    fn plain(&mut self) -> f64 {
        self.0.next().copied().unwrap_or_default()
    }

    fn positive(&mut self) -> f64 {
        self.plain().clamp(LOGARITHMS.0, LOGARITHMS.1).exp()
    }

    /// Values relative to the first one, which is 1.
    fn after_first(&mut self, count: usize) -> Vec<f64> {
        let value = |index| if index == 0 { 1.0 } else { self.positive() };
        (0..count).map(value).collect()
    }

    /// Of a spring: products of two of them stay within their bounds.
    fn three(&mut self) -> [f64; 3] {
        std::array::from_fn(|_| self.plain().clamp(LOGARITHMS.0, 0.5 * LOGARITHMS.1).exp())
    }
}

#[cfg(test)]
mod tests {
    use i2ris::model::hysteresis::stop::Stops;
    use proptest::prelude::*;

    use super::super::initial_guess::initial_guess;
    use super::super::structure::Structure;
    use super::*;
    use nalgebra::{Matrix2, SVector};

    fn guess(segments: usize) -> StopParameters {
        let gain = Matrix2::new(0.02, 0.015, -0.015, 0.02);
        let neutral = SVector::from([10.0, -30.0]);
        initial_guess::<2>(&gain, &neutral, 30.0, Structure::new(segments, 3))
    }

    #[test]
    fn decoding_inverts_encoding() {
        for segments in 1..=3 {
            let (parameterisation, parameters) =
                (Parameterisation::new(&guess(segments)), guess(segments));
            let code = parameterisation.encode(&parameters);
            let decoded = parameterisation.decode(&code);
            assert!((parameterisation.encode(&decoded) - code).amax() < 1e-9);
            assert_eq!((decoded.segments.len(), decoded.stops.len()), (segments, 3));
        }
    }

    proptest! {
        #[test]
        fn every_decoded_vector_gives_an_operator(
            code in prop::collection::vec(-40.0..40.0_f64, 50), segments in 1..=3_usize,
        ) {
            let parameterisation = Parameterisation::new(&guess(segments));
            let mut code = DVector::from_vec(code);
            // The directions of the motors.
            (code[12], code[13]) = (0.3, 1.9);
            prop_assert!(Stops::<2>::prepare(&parameterisation.decode(&code)).is_ok());
        }
    }
}
