//! The snakes of the pairs: simple plants with formulae of their own, and their models.

use i2ris::model::network::NetworkParameters;

use i2ris_testing::families::{averages, gru};

use super::*;

/// Parameters of `balance_model`: stiffness of two wires and of the spring, friction of its stop.
const WIRES: f64 = 2.0;
const SPRING: f64 = 0.1;
const STOP: f64 = 10.0;
const FRICTION: f64 = 40.0;

/// Transmission between a motor and the snake.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Wire {
    /// Nothing.
    Taut,
    /// Half of the wire follows at once, the other half after a gap.
    Halved,
    /// A gap, and then friction that stretches the wire.
    Balance,
    /// Nothing except the hundredth that a network adds to the straight line.
    Network,
    /// Nothing; the outputs are a tip position, mm.
    Place,
}

pub const WIRES_OF_SNAKES: [Wire; 7] = [
    Wire::Taut,
    Wire::Taut,
    Wire::Halved,
    Wire::Balance,
    Wire::Balance,
    Wire::Network,
    Wire::Place,
];

impl Wire {
    /// Half of the gap, counts.
    fn gap(self) -> f64 {
        match self {
            Self::Halved => 100.0,
            Self::Balance => 30.0,
            Self::Taut | Self::Network | Self::Place => 0.0,
        }
    }

    pub fn unit(self) -> OutputUnit {
        if self == Self::Place { OutputUnit::Mm } else { OutputUnit::Deg }
    }

    /// Outputs of a model in degrees, or mm.
    pub fn angles(self, [pitch, yaw, _]: OutputVec) -> [f64; 2] {
        [pitch, yaw].map(|value| value / self.si())
    }

    /// The other way round.
    pub fn outputs(self, [pitch, yaw]: [f64; 2]) -> OutputVec {
        [pitch * self.si(), yaw * self.si(), 0.0]
    }

    fn si(self) -> f64 {
        if self == Self::Place { 1e-3 } else { 1.0_f64.to_radians() }
    }

    /// A model of a snake whose bend is scaled by a factor, calibrated within these corners.
    pub fn model(self, factor: f64, hull: &[[f64; 2]]) -> Arc<Model> {
        let model = match self {
            Self::Halved => scaled_play_model(factor),
            Self::Balance => scaled_balance_model(factor),
            Self::Taut | Self::Network | Self::Place => self.straight(factor),
        };
        within(&model, hull)
    }

    fn straight(self, factor: f64) -> Arc<Model> {
        let mut file = model(self.unit()).file().clone();
        let FamilyParameters::Linear { gain, covariance, .. } = &mut file.family else {
            unreachable!("it is linear")
        };
        gain.iter_mut().flatten().for_each(|gain| *gain *= factor);
        if self == Self::Network {
            let (gain, covariance) = (gain.clone(), covariance.clone());
            let network = NetworkParameters {
                step_counts: 10.0,
                input_centre: vec![0.0; 2],
                input_scale: vec![0.002; 2],
                layers: vec![gru(4), averages(4)],
                output_gain: vec![vec![0.02, 0.01], vec![-0.01, 0.02]],
                output_offset: vec![0.0; 2],
                skip_gain: gain.clone(),
            };
            file.training.linear_gain = Some(gain.clone());
            let memory_counts = vec![200.0; 2];
            file.family = FamilyParameters::Network { network, memory_counts, gain, covariance };
        }
        Arc::new(Model::from_file(file).unwrap())
    }
}

/// Pulley of a motor, bend in counts, and offset held by its friction.
#[derive(Debug, Clone, Copy, Default)]
struct Motor {
    pulley: f64,
    bend: f64,
    held: f64,
}

/// The snake and its bend per motor count.
#[derive(Debug, Clone, Copy)]
pub struct Snake {
    pub wire: Wire,
    pub gain: f64,
    motors: [Motor; 2],
}

impl Snake {
    pub fn new(wire: Wire) -> Self {
        Self { wire, gain: GAIN_DEG, motors: [Motor::default(); 2] }
    }

    /// Moves a motor. Returns the counts that it would have without gap and friction.
    fn moved(&self, motor: usize, counts: f64) -> (Motor, f64) {
        let before = self.motors[motor];
        let gap = self.wire.gap();
        let pulley = before.pulley.max(counts - gap).min(counts + gap);
        match self.wire {
            Wire::Taut | Wire::Network | Wire::Place => (before, counts),
            Wire::Halved => (Motor { pulley, ..before }, 0.5 * (counts + pulley)),
            Wire::Balance => {
                // Friction holds as a spring does, up to its limit.
                let tried = (WIRES * pulley - STOP * before.held + STOP * before.bend)
                    / (WIRES + SPRING + STOP);
                let most = FRICTION / STOP;
                let held = (before.held + tried - before.bend).clamp(-most, most);
                let bend = (WIRES * pulley - STOP * held) / (WIRES + SPRING);
                let bend = if held.abs() < most { tried } else { bend };
                (Motor { pulley, bend, held }, bend * (WIRES + SPRING) / WIRES)
            }
        }
    }

    pub fn pose(&self, counts: [f64; 2]) -> [f64; 2] {
        let [a, b] = [0, 1].map(|motor: usize| self.moved(motor, counts[motor]).1);
        [self.gain * (a + b), self.gain * (b - a)]
    }

    pub fn follow(&mut self, counts: [f64; 2]) {
        self.motors = [0, 1].map(|motor: usize| self.moved(motor, counts[motor]).0);
    }
}

pub fn wire(random: &mut Random) -> Wire {
    WIRES_OF_SNAKES[random.below(WIRES_OF_SNAKES.len() as u64) as usize]
}
