//! Motor, encoder and position controller of one drive; the demand, moved by profiles and ramps.

use super::device_file::DeviceFile;
use super::family::Family;

/// Parameters of the motor and its position controller.
#[derive(Debug, Clone, PartialEq)]
pub struct MotorConfig {
    /// Pulses of the encoder per turn; four increments (counts) each.
    pub encoder_pulses: u32,
    /// Bandwidth of the position loop, Hz. It lags a ramp by the ramp over pi times this.
    pub bandwidth_hz: f64,
    /// Acceleration per current, counts per second squared and mA.
    pub acceleration_per_ma: f64,
    /// Current that overcomes friction, mA.
    pub friction_ma: f64,
    /// Current that holds the load of the wires, mA per degree of wire stretch.
    pub load_ma_per_deg: f64,
    /// Positive current turns the motor against the counting direction of its encoder.
    pub reversed: bool,
    /// Play of its gear, counts.
    pub gear_play: f64,
    /// Current that overcomes the friction after the gear, mA: only while a flank pushes.
    pub output_friction_ma: f64,
    /// Hard stops, counts from the position of the motor at the start of the emulator.
    pub stops: [f64; 2],
}

impl Default for MotorConfig {
    /// Close to a maxon DCX 8 M with a gearhead: 0.9 mNm at 300 mA on 3e-9 kg m2, of which the gear
    /// leaves a third.
    fn default() -> Self {
        Self {
            encoder_pulses: 256,
            bandwidth_hz: 60.0,
            acceleration_per_ma: 33_000.0,
            friction_ma: 2.0,
            load_ma_per_deg: 4.0,
            reversed: false,
            gear_play: 0.0,
            output_friction_ma: 0.0,
            stops: [-100_000.0, 100_000.0],
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Output current, mA (object 0x3001:02).
    pub current_ma: f64,
    /// Speed, counts per second (object 0x6080).
    pub speed: f64,
}

/// The motor. Positions are true ones: fractional counts since the start of the emulator.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Motor {
    pub position: f64,
    /// Counts per second.
    pub velocity: f64,
    pub current_ma: f64,
    /// Load of the wires, degrees of wire stretch; positive: it pulls back to lower counts.
    pub load: f64,
    /// Centre of the gear play, counts.
    pub output: f64,
    /// The lowest and the highest position so far, counts.
    pub reached: [f64; 2],
    /// The last step met a limit.
    pub limited: bool,
}

/// Speeds below this are standstill, counts per second.
const STANDSTILL: f64 = 20.0;

impl Motor {
    /// A motor at standstill at this position.
    pub fn at(position: f64) -> Self {
        Self { position, output: position, reached: [position; 2], ..Self::default() }
    }

    pub fn is_at_standstill(&self) -> bool {
        self.velocity.abs() < STANDSTILL
    }

    /// One step under the position controller (PD, critically damped) with Coulomb friction. The
    /// load is balanced, as by an integral part without lag: it shows in the current only.
    pub fn follow(&mut self, config: &MotorConfig, demand: f64, limits: Limits, dt_s: f64) {
        let rate = std::f64::consts::TAU * config.bandwidth_hz;
        let target = rate * rate * (demand - self.position) - 2.0 * rate * self.velocity;
        let load_ma = self.load * config.load_ma_per_deg;
        let target_ma = target / config.acceleration_per_ma + load_ma;
        self.drive(config, target_ma, load_ma, limits, dt_s);
    }

    /// One step under a given current. The gear is self-locking: the load brakes, but never drives.
    pub fn push(&mut self, config: &MotorConfig, target_ma: f64, limits: Limits, dt_s: f64) {
        let load_ma = self.load * config.load_ma_per_deg;
        let braking = if load_ma * target_ma > 0.0 {
            load_ma.clamp(-target_ma.abs(), target_ma.abs())
        } else {
            0.0
        };
        self.drive(config, target_ma, braking, limits, dt_s);
    }

    fn drive(
        &mut self,
        config: &MotorConfig,
        target_ma: f64,
        load_ma: f64,
        limits: Limits,
        dt_s: f64,
    ) {
        self.current_ma = target_ma.clamp(-limits.current_ma, limits.current_ma);
        let before = self.velocity;
        let turning_ma = if config.reversed { -self.current_ma } else { self.current_ma };
        let driven = before + (turning_ma - load_ma) * config.acceleration_per_ma * dt_s;
        let off_middle = self.position - self.output;
        let at_flank = off_middle.abs() >= 0.5 * config.gear_play - 1e-6;
        let pushes = at_flank && off_middle * driven >= 0.0;
        let behind_ma = if pushes { config.output_friction_ma } else { 0.0 };
        let friction = (config.friction_ma + behind_ma) * config.acceleration_per_ma * dt_s;
        let velocity = (driven.abs() - friction).max(0.0).copysign(driven);
        self.limited = self.current_ma != target_ma || velocity.abs() > limits.speed;
        self.velocity = velocity.clamp(-limits.speed, limits.speed);
        self.position += 0.5 * (before + self.velocity) * dt_s;
        let [low, high] = config.stops;
        if self.position < low || self.position > high {
            self.position = self.position.clamp(low, high);
            self.velocity = 0.0;
        }
        let [lowest, highest] = self.reached;
        self.reached = [lowest.min(self.position), highest.max(self.position)];
        let half = 0.5 * config.gear_play;
        self.output = self.output.clamp(self.position - half, self.position + half);
    }

    /// One step without power. Friction brakes; the gear is self-locking.
    pub fn coast(&mut self, config: &MotorConfig, dt_s: f64) {
        let limits = Limits { current_ma: 0.0, speed: f64::INFINITY };
        self.push(config, 0.0, limits, dt_s);
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct DriveConfig {
    pub family: Family,
    /// The objects of a real drive of the family. Absent: all known objects of the family.
    pub device: Option<DeviceFile>,
    /// CAN node id (object 0x2000). The drive also answers to 0.
    pub node_id: u8,
    /// Serial number (objects 0x1018:04 and 0x2100:01; EPOS2 0x2004).
    pub serial_number: u32,
    pub motor: MotorConfig,
    /// Time without any reply after a reset or power-up, milliseconds.
    pub boot_ms: u64,
    /// A fault that is present after every boot, such as 0x8120 when no CAN bus is connected.
    pub boot_fault: Option<u16>,
    /// Data words of an error reply to a read, 2 or 4. maxon does not document the length.
    pub error_reply_words: u8,
    /// Fill the unused upper bytes of short values with garbage, as first-generation drives do.
    pub fill_unused_bytes: bool,
    /// Short values have one data word instead of two, as some hosts have read them.
    pub one_word_reads: bool,
    /// Maximum bytes in one segment of a segmented read, 1 to 255.
    pub segment_bytes: u8,
    /// Timeout of a request to another node, milliseconds.
    pub gateway_timeout_ms: u64,
    /// Interpolation (0x60C2:01 above 0) expects setpoints in time on a serial line: fault 0x8250.
    pub interpolation_timeout: bool,
    /// Whether a halt acts in the modes that follow every setpoint.
    pub cyclic_halt: bool,
    /// A setpoint beyond the limits is clipped to them, even if the family has a fault for it.
    pub clips_setpoints: bool,
    /// The gateway forwards segmented reads.
    pub forwards_segments: bool,
    /// Fault 0x8130 after this time with power and without a request, milliseconds.
    pub silence_fault_ms: Option<u64>,
}

impl Default for DriveConfig {
    fn default() -> Self {
        Self {
            family: Family::default(),
            device: None,
            node_id: 1,
            serial_number: 62_000_001,
            motor: MotorConfig::default(),
            boot_ms: 300,
            boot_fault: None,
            error_reply_words: 2,
            fill_unused_bytes: true,
            one_word_reads: false,
            segment_bytes: 255,
            gateway_timeout_ms: 100,
            interpolation_timeout: true,
            cyclic_halt: true,
            clips_setpoints: false,
            forwards_segments: false,
            silence_fault_ms: None,
        }
    }
}

/// Limits of speed and acceleration, counts and seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProfileLimits {
    pub speed: f64,
    pub acceleration: f64,
    pub deceleration: f64,
}

impl ProfileLimits {
    /// The same ramp for acceleration and deceleration.
    pub fn with_ramp(speed: f64, ramp: f64) -> Self {
        Self { speed, acceleration: ramp, deceleration: ramp }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Demand {
    pub position: f64,
    /// Counts per second.
    pub velocity: f64,
}

impl Demand {
    pub fn new(position: f64, velocity: f64) -> Self {
        Self { position, velocity }
    }

    /// Moves one step towards a target at rest. Returns true at the target.
    pub fn approach(&mut self, target: f64, limits: ProfileLimits, dt_s: f64) -> bool {
        let distance = target - self.position;
        let braking = (2.0 * limits.deceleration * distance.abs()).sqrt();
        self.change_speed(braking.min(limits.speed).copysign(distance), limits, dt_s);
        let next = self.position + self.velocity * dt_s;
        let slow = self.velocity.abs() <= 2.0 * limits.deceleration * dt_s;
        if (target - next) * distance <= 0.0 && slow {
            *self = Self::new(target, 0.0);
            return true;
        }
        self.position = next;
        false
    }

    /// Moves one step at a speed.
    pub fn run(&mut self, speed: f64, limits: ProfileLimits, dt_s: f64) {
        self.change_speed(speed.clamp(-limits.speed, limits.speed), limits, dt_s);
        self.position += self.velocity * dt_s;
    }

    /// Brakes for one step. Returns true at standstill.
    pub fn brake(&mut self, deceleration: f64, dt_s: f64) -> bool {
        self.run(0.0, ProfileLimits::with_ramp(f64::MAX, deceleration), dt_s);
        self.velocity == 0.0
    }

    fn change_speed(&mut self, target: f64, limits: ProfileLimits, dt_s: f64) {
        let slower = target * self.velocity <= 0.0 || target.abs() < self.velocity.abs();
        let brakes = slower && self.velocity != 0.0;
        let ramp = if brakes { limits.deceleration } else { limits.acceleration };
        let most = dt_s * ramp;
        self.velocity += (target - self.velocity).clamp(-most, most);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const LIMITS: Limits = Limits { current_ma: 300.0, speed: 50_000.0 };
    const DT_S: f64 = 0.0005;

    /// Follows a demand; returns the motor and its highest speed.
    fn run(limits: Limits, seconds: f64, demand: impl Fn(f64) -> f64) -> (Motor, f64) {
        let (config, mut motor, mut top) = (MotorConfig::default(), Motor::default(), 0.0f64);
        for step in 0..(seconds / DT_S) as usize {
            motor.follow(&config, demand(step as f64 * DT_S), limits, DT_S);
            top = top.max(motor.velocity.abs());
        }
        (motor, top)
    }

    #[test]
    fn settles_within_a_count() {
        let (motor, _) = run(LIMITS, 0.2, |_| 200.0);
        assert!((motor.position - 200.0).abs() < 1.0 && motor.is_at_standstill(), "{motor:?}");
    }

    #[test]
    fn the_lag_behind_a_ramp_follows_from_the_bandwidth() {
        let lag = 500.0 - run(LIMITS, 0.5, |time| 1000.0 * time).0.position;
        assert!((4.0..8.0).contains(&lag), "{lag}");
    }

    #[test]
    fn speed_and_current_are_limited() {
        assert!(run(Limits { speed: 1000.0, ..LIMITS }, 0.1, |_| 5000.0).1 <= 1000.0);
        let (weak, _) = run(Limits { current_ma: 1.0, ..LIMITS }, 0.2, |_| 500.0);
        assert_eq!(weak.position, 0.0, "1 mA does not overcome the friction");
    }

    #[test]
    fn a_hard_stop_blocks_the_motor_and_raises_the_current() {
        let config = MotorConfig { stops: [-100.0, 100.0], ..MotorConfig::default() };
        let mut motor = Motor::default();
        for _ in 0..400 {
            motor.follow(&config, 300.0, LIMITS, DT_S);
        }
        assert_eq!((motor.position, motor.velocity), (100.0, 0.0));
        assert!(motor.current_ma > 100.0, "{motor:?}");
    }

    #[test]
    fn the_current_shows_the_load_and_the_position_does_not() {
        let run = |load: f64| {
            let (config, mut motor) = (MotorConfig::default(), Motor::default());
            for step in 0..400 {
                motor.load = load;
                motor.follow(&config, 0.5 * f64::from(step), LIMITS, DT_S);
            }
            motor
        };
        let (free, loaded) = (run(0.0), run(5.0));
        assert_eq!(free.position, loaded.position);
        assert!((loaded.current_ma - free.current_ma - 20.0).abs() < 1e-6);
        // Moving takes the friction.
        assert!((free.current_ma - 2.0).abs() < 0.5, "{free:?}");
    }

    #[test]
    fn a_load_does_not_turn_the_gear() {
        let mut motor = Motor { load: 8.0, ..Motor::default() };
        for _ in 0..100 {
            motor.coast(&MotorConfig::default(), DT_S);
            motor.push(&MotorConfig::default(), 20.0, LIMITS, DT_S);
            motor.push(&MotorConfig::default(), -1.0, LIMITS, DT_S);
        }
        assert_eq!(motor.position, 0.0);
    }

    #[test]
    fn friction_stops_a_motor_without_power() {
        let mut motor = Motor { velocity: 2000.0, ..Motor::default() };
        for _ in 0..400 {
            motor.coast(&MotorConfig::default(), DT_S);
        }
        assert!(motor.velocity == 0.0 && motor.position > 5.0);
    }

    proptest! {
        #[test]
        fn a_profile_reaches_its_target_within_its_limits(
            target in -5000.0..5000.0f64,
            start in -3000.0..3000.0f64,
        ) {
            let ramp = 30_000.0;
            let limits = ProfileLimits::with_ramp(2000.0, ramp);
            let limits = ProfileLimits { acceleration: 20_000.0, ..limits };
            let mut demand = Demand::new(0.0, start.clamp(-2000.0, 2000.0));
            let dt_s = 0.0005;
            let mut arrived = false;
            for _ in 0..20_000 {
                let before = demand;
                arrived = demand.approach(target, limits, dt_s);
                prop_assert!(demand.velocity.abs() <= 2000.0 + 1e-9);
                // The last step ends on the target and may brake by a little more than one step.
                let change = (demand.velocity - before.velocity).abs();
                prop_assert!(change <= 3.0 * ramp * dt_s + 1e-9);
                if arrived {
                    break;
                }
            }
            prop_assert!(arrived && demand.position == target, "{:?}", demand);
        }
    }

    #[test]
    fn the_braking_distance_is_the_physical_one() {
        let mut demand = Demand::new(0.0, 2000.0);
        while !demand.brake(100_000.0, 1e-5) {}
        assert!((demand.position - 20.0).abs() < 0.1, "{demand:?}");
    }
}
