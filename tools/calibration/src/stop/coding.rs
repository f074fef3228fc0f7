//! Between the parameters of stop operators and a vector of numbers without bounds.
//!
//! Lengths, forces and stiffnesses are positive and differ by orders of magnitude, so their
//! logarithms are searched.

use i2ris::model::hysteresis::stop::{
    LEAST, StopAxis, StopElement, StopMotor, StopParameters, StopSegment,
};
use nalgebra::DVector;

/// Logarithms stay between these: 1e-6 to 3000.
const LOGARITHMS: (f64, f64) = (-14.0, 8.0);

/// The least stiffness of a spring.
const LEAST_STIFFNESS: f64 = 1e-6;

/// A scale for the parameters that a search starts from.
#[derive(Debug, Clone)]
pub(super) struct Coding {
    motors: usize,
    segments: usize,
    stops: usize,
    /// Neutral counts and travel per count of the start: both are coded relative to them.
    neutral: Vec<(f64, f64)>,
}

impl Coding {
    pub fn new(start: &StopParameters) -> Self {
        let neutral = start
            .motors
            .iter()
            .map(|motor| (motor.neutral_counts, motor.travel_per_count))
            .collect();
        Self {
            motors: start.motors.len(),
            segments: start.segments.len(),
            stops: start.stops.len(),
            neutral,
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
            code.extend(
                parameters
                    .motors
                    .iter()
                    .map(|motor| motor.axis_deg.to_radians()),
            );
            code.push((parameters.shared / (1.0 - parameters.shared)).ln());
        }
        code.extend(springs(parameters).into_iter().flatten().map(f64::ln));
        let friction = parameters
            .segments
            .first()
            .map_or(1.0, |segment| segment.friction);
        code.extend(
            parameters
                .segments
                .iter()
                .skip(1)
                .map(|segment| (segment.friction / friction).ln()),
        );
        let StopParameters {
            softness,
            loose_stiffness,
            base_friction,
            friction_growth,
            ..
        } = *parameters;
        code.extend([softness, loose_stiffness, base_friction, friction_growth].map(f64::ln));
        code.extend(parameters.stops.iter().map(|stop| stop.stiffness.ln()));
        let first = parameters.stops.first().map_or(1.0, |stop| stop.share);
        code.extend(
            parameters
                .stops
                .iter()
                .skip(1)
                .map(|stop| (stop.share / first).ln()),
        );
        DVector::from_vec(code)
    }

    /// Always parameters within their bounds; only the directions of the motors may fall together.
    pub fn decode(&self, code: &DVector<f64>) -> StopParameters {
        let mut code = Reader(code.as_slice().iter());
        let mut motors: Vec<StopMotor> = self
            .neutral
            .iter()
            .map(|neutral| motor(&mut code, *neutral))
            .collect();
        let mut shared = 0.0;
        if self.motors == 2 {
            motors
                .iter_mut()
                .for_each(|motor| motor.axis_deg = code.plain().to_degrees() % 360.0);
            shared = 1.0 / (1.0 + (-code.plain()).exp());
        }
        let segments = self.segments(&mut code);
        let softness = code.positive().max(LEAST);
        let loose_stiffness = code.positive().clamp(LEAST, 1.0);
        let base_friction = code.positive();
        let friction_growth = code.positive().min(1.0);
        let stiffnesses: Vec<f64> = (0..self.stops).map(|_| code.positive().max(1e-4)).collect();
        let shares: Vec<f64> = (0..self.stops)
            .map(|stop| if stop == 0 { 1.0 } else { code.positive() })
            .collect();
        let sum: f64 = shares.iter().sum();
        let stops = stiffnesses.into_iter().zip(shares);
        let stops = stops
            .map(|(stiffness, share)| StopElement {
                stiffness,
                share: share / sum,
            })
            .collect();
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
}

impl Coding {
    fn segments(&self, code: &mut Reader) -> Vec<StopSegment> {
        let springs: Vec<[f64; 3]> = (0..self.segments).map(|_| code.three()).collect();
        let others: Vec<[f64; 3]> = (1..self.motors).map(|_| code.three()).collect();
        let friction: Vec<f64> = (0..self.segments)
            .map(|s| if s == 0 { 1.0 } else { code.positive() })
            .collect();
        let mean = friction.iter().sum::<f64>() / friction.len().max(1) as f64;
        let axes = |spring: &[f64; 3]| {
            let of = |ratio: &[f64; 3]| StopAxis {
                stiffness: (spring[0] * ratio[0]).max(LEAST_STIFFNESS),
                stiffening: spring[1] * ratio[1],
                limit: (spring[2] * ratio[2]).max(LEAST),
            };
            std::iter::once(&[1.0; 3]).chain(&others).map(of).collect()
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
    if let [one, other] = parameters
        .segments
        .first()
        .map_or(&[][..], |segment| &segment.axes)
    {
        let (one, other) = (numbers(one), numbers(other));
        springs.push(std::array::from_fn(|i| other[i] / one[i]));
    }
    springs
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

    /// Of a spring: products of two of them stay within their bounds.
    fn three(&mut self) -> [f64; 3] {
        std::array::from_fn(|_| self.plain().clamp(LOGARITHMS.0, 0.5 * LOGARITHMS.1).exp())
    }
}

#[cfg(test)]
mod tests {
    use i2ris::model::hysteresis::stop::Stops;
    use proptest::prelude::*;

    use super::super::Structure;
    use super::super::start::start;
    use super::*;
    use nalgebra::{Matrix2, SVector};

    fn of(segments: usize) -> StopParameters {
        let structure = Structure { segments, stops: 3 };
        start::<2>(
            &Matrix2::new(0.02, 0.015, -0.015, 0.02),
            &SVector::from([10.0, -30.0]),
            30.0,
            structure,
        )
    }

    #[test]
    fn what_is_encoded_is_decoded() {
        for segments in 1..=3 {
            let (coding, parameters) = (Coding::new(&of(segments)), of(segments));
            let code = coding.encode(&parameters);
            let decoded = coding.decode(&code);
            assert!((coding.encode(&decoded) - code).amax() < 1e-9);
            assert_eq!((decoded.segments.len(), decoded.stops.len()), (segments, 3));
        }
    }

    proptest! {
        #[test]
        fn whatever_is_decoded_can_be_run(
            code in prop::collection::vec(-40.0..40.0_f64, 50), segments in 1..=3_usize,
        ) {
            let coding = Coding::new(&of(segments));
            let mut code = DVector::from_vec(code);
            // The directions of the motors.
            (code[12], code[13]) = (0.3, 1.9);
            prop_assert!(Stops::<2>::prepare(&coding.decode(&code)).is_ok());
        }
    }
}
