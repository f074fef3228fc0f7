//! A tick of the controller with ideal drives, the same motion every time.

use std::collections::VecDeque;
use std::f64::consts::TAU;
use std::path::Path;
use std::sync::Arc;

use i2ris::config::{Config, MAX_REGIONS};
use i2ris::core::{ExternalPose, ServoGoal};
use i2ris::model::Model;
use i2ris::model::kinematic::tip_position;
use i2ris::robot::StateCommand;
use i2ris::units::{Nanos, OutputVec};
use i2ris_simulation::closed_loop::{ClosedLoop, IdealMotors};

use crate::Failure;

/// The configuration with limits and filters.
pub const CONFIG: &str = include_str!("../../../config/emulator.toml");

/// The camera: interval and age of its frames, and their offset from the calibration, rad.
const FRAME_INTERVAL: Nanos = Nanos::from_millis(33);
const FRAME_AGE: Nanos = Nanos::from_millis(60);
const SHIFT: [f64; 3] = [0.01, -0.006, 0.0];

/// Range of the motion on both axes, degrees; with regions for the tip, and their distance.
const REACH_DEG: f64 = 5.0;
const REACH_AT_REGIONS_DEG: f64 = 9.0;
const FREE_DEG: f64 = 6.0;

/// Additional duties of the controller.
#[derive(Debug, Clone, Copy, Default)]
pub struct Duties {
    /// Follow the drift with a camera.
    pub adapts: bool,
    /// Keep out of the maximum number of regions for the tip.
    pub keeps_out: bool,
}

/// The cycle of the controller, which follows a motion with ideal drives.
#[derive(Debug)]
pub struct Cycle {
    control: ClosedLoop<IdealMotors>,
    /// Where the conditioning cycle leaves the snake, rad.
    start: OutputVec,
    seconds: f64,
    reach_deg: f64,
    /// Ticks in which a region limited the goal.
    limited: u64,
    /// With adaptation only.
    camera: Option<Camera>,
}

/// Frames on their way, with their arrival.
#[derive(Debug, Default)]
struct Camera {
    frames: VecDeque<(Nanos, ExternalPose)>,
    next: Nanos,
}

impl Cycle {
    /// An enabled cycle with known memory after a conditioning cycle; with adaptation also a
    /// camera.
    pub fn new(period: Nanos, model: &Arc<Model>, duties: Duties) -> Result<Self, Failure> {
        let Duties { adapts, keeps_out } = duties;
        let reach_deg = if keeps_out { REACH_AT_REGIONS_DEG } else { REACH_DEG };
        let text = if keeps_out { format!("{CONFIG}{}", regions()) } else { CONFIG.to_owned() };
        let mut config = Config::parse(&text, Path::new("config/emulator.toml"))?;
        config.control.rate_hz = (1_000_000_000 / period.0.max(1)) as u32;
        config.adaptation.enabled = adapts;
        let mut control = ClosedLoop::new(&config, model, IdealMotors::default());
        control.command(StateCommand::Enable)?;
        control.command(StateCommand::Condition)?;
        Ok(Self {
            start: control.report().joint.map_or([0.0; 3], |joint| joint.setpoint),
            camera: adapts.then(Camera::default),
            control,
            seconds: 0.0,
            reach_deg,
            limited: 0,
        })
    }

    /// One tick; whether a frame of the camera arrived in it.
    pub fn step(&mut self) -> Result<bool, Failure> {
        self.seconds += self.control.period().as_seconds();
        let external = self.camera.as_mut().and_then(|camera| camera.frame(&self.control));
        let report = self.control.follow_with(self.goal(), external)?;
        self.limited += u64::from(report.limited_by_fixture.is_some());
        Ok(external.is_some())
    }

    /// Ticks in which a region limited the goal.
    pub fn limited(&self) -> u64 {
        self.limited
    }

    /// Two frequencies with a long common period: both motors turn at many positions. The goal is
    /// within the limits: at most 5 deg/s, or 9 with regions.
    fn goal(&self) -> ServoGoal {
        let axis = |hz: f64| self.reach_deg.to_radians() * (TAU * hz * self.seconds).sin();
        ServoGoal::Joint([self.start[0] + axis(0.15), self.start[1] + axis(0.093), 0.0], 2)
    }

    /// Frames used for learning.
    pub fn learned(&self) -> u64 {
        self.control.report().adaptation.map_or(0, |adaptation| adaptation.frames.used)
    }
}

impl Camera {
    /// Takes a frame at its interval; the one that arrives in the next tick.
    fn frame(&mut self, control: &ClosedLoop<IdealMotors>) -> Option<ExternalPose> {
        let now = control.next();
        if now >= self.next
            && let Some(joint) = control.report().joint
        {
            self.next = now + FRAME_INTERVAL;
            let pose = ExternalPose {
                stamp: now,
                position: [0, 1, 2].map(|output: usize| joint.measured[output] + SHIFT[output]),
                outputs: 2,
                quality: 1.0,
            };
            self.frames.push_back((now + FRAME_AGE, pose));
        }
        let (_, pose) = *self.frames.front().filter(|(arrival, _)| *arrival <= now)?;
        self.frames.pop_front();
        Some(pose)
    }
}

/// Walls and balls in turn around the straight snake: most of the motion glides along one or two.
fn regions() -> String {
    let tip = |deg: f64| tip_position(deg.to_radians(), 0.0).position_m.map(|metre| 1e3 * metre);
    let [[_, reach, height], [_, radius, _]] = [tip(FREE_DEG), tip(20.0)];
    let table = |index: usize| {
        let (y, x) = (TAU * index as f64 / MAX_REGIONS as f64).sin_cos();
        let [from_x, from_y] = [x, y].map(|part| part * (reach + radius));
        let shape = match index % 2 {
            0 => format!("half_space = {{ normal = [{x}, {y}, 0.0], offset_mm = {reach} }}"),
            _ => format!(
                "ball = {{ centre_mm = [{from_x}, {from_y}, {height}], radius_mm = {radius} }}"
            ),
        };
        format!("[[virtual_fixtures]]\nname = \"r{index}\"\nshape = {{ {shape} }}\n")
    };
    (0..MAX_REGIONS).map(table).collect()
}
