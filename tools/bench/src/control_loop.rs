//! A periodic loop: lateness of its ticks, and computing time of the controller with ideal drives.

use std::collections::VecDeque;
use std::f64::consts::TAU;
use std::path::Path;
use std::sync::Arc;

use i2ris::clock;
use i2ris::config::{Config, MAX_REGIONS};
use i2ris::core::{ExternalPose, ServoGoal};
use i2ris::model::Model;
use i2ris::model::kinematic::tip_position;
use i2ris::realtime::Ticker;
use i2ris::robot::StateCommand;
use i2ris::units::{Nanos, OutputVec};
use i2ris_simulation::closed_loop::{ClosedLoop, IdealMotors};

use crate::Failure;
use crate::inverse::two_clock_readings;
use crate::machine::{Run, in_thread};
use crate::outcome::{Durations, Found, Outcome, Quantity, Role, Variant};

/// The controller's ticker wakes this long before each tick and polls the clock until then.
const SPIN: Nanos = Nanos::from_micros(100);
/// Duration of one turn of a variant. Short turns give all variants the same machine load.
const TURN: Nanos = Nanos::from_millis(1000);
const WARM_UP: u64 = 200;

const LATE: [(&str, Role); 3] = [
    ("bare timer (clock_nanosleep)", Role::Floor),
    ("ticker of the controller", Role::Ours),
    ("the same with adaptation", Role::Ours),
];
const COMPUTING: [(&str, Role); 6] = [
    ("two readings of the clock", Role::Floor),
    ("one tick: gate, inverse, limits, states", Role::Ours),
    ("the same with adaptation", Role::Ours),
    ("one of these with a frame of the camera", Role::Ours),
    ("one tick at eight regions for the tip", Role::Ours),
    ("the same with adaptation and camera", Role::Ours),
];

/// Runs the ticker of the controller with its cycle, without and with adaptation, and a bare timer,
/// in turns; with regions only the computing time.
/// `turns`: one-second turns of each variant, at one rate or more. `subject`: the model of the
/// controller, and its name.
pub fn run(
    periods: &[Nanos],
    turns: u32,
    subject: (Model, String),
    run: Run,
) -> Result<Outcome, Failure> {
    let about = "A periodic loop: lateness of its ticks, and computing time of a tick of the \
                 controller";
    Outcome::of("loop", about, || in_thread(|| measure(periods, turns, subject, run)))
}

struct Rate {
    period: Nanos,
    // Four times the size of a stack.
    cycle: Box<Cycle>,
    adapting: Box<Cycle>,
    /// The same two, with regions for the tip.
    at_regions: [Box<Cycle>; 2],
    late: [Durations; 3],
    computing: [Durations; 6],
}

impl Rate {
    fn new(period: Nanos, model: &Arc<Model>) -> Result<Self, Failure> {
        let cycle = |at_regions, adapts| Cycle::new(period, model, at_regions, adapts);
        Ok(Self {
            period,
            cycle: cycle(false, false)?.into(),
            adapting: cycle(false, true)?.into(),
            at_regions: [cycle(true, false)?.into(), cycle(true, true)?.into()],
            late: LATE.map(|_| Durations::new(WARM_UP)),
            computing: [WARM_UP, WARM_UP, WARM_UP, 0, WARM_UP, WARM_UP].map(Durations::new),
        })
    }

    /// One turn of the bare timer, and one of the ticker for each way to compute a tick.
    fn turns(&mut self) -> Result<(), Failure> {
        let Self { period, cycle, adapting, at_regions, late, computing } = self;
        let [timer, ticker, adapting_late] = late;
        let [nothing, tick, adapting_tick, with_frame, at_region @ ..] = computing;
        run_turn(*period, Nanos::ZERO, timer, || {
            nothing.push(two_clock_readings());
            Ok(())
        })?;
        let turn = |cycle: &mut Cycle, lateness: &mut Durations, durations: &mut Durations| {
            run_turn(*period, SPIN, lateness, || {
                let begin = clock::now();
                cycle.step()?;
                durations.push(clock::now().duration_since(begin));
                Ok(())
            })
        };
        turn(cycle, ticker, tick)?;
        run_turn(*period, SPIN, adapting_late, || {
            let begin = clock::now();
            let has_frame = adapting.step()?;
            let time = clock::now().duration_since(begin);
            adapting_tick.push(time);
            if has_frame {
                with_frame.push(time);
            }
            Ok(())
        })?;
        for (cycle, durations) in at_regions.iter_mut().zip(at_region) {
            turn(cycle, &mut Durations::new(WARM_UP), durations)?;
        }
        Ok(())
    }

    fn ticks_per_s(&self) -> f64 {
        1e9 / self.period.0 as f64
    }

    fn quantities(&self) -> [Quantity; 5] {
        let limited: u64 = self.at_regions.iter().map(|cycle| cycle.limited).sum();
        let median_us = self.computing[1].percentiles().p50 as f64 / 1e3;
        let busy = 1e5 * median_us / self.period.0 as f64;
        [
            Quantity::new("ticks per second", self.ticks_per_s(), "1/s"),
            Quantity::new("computing, of the period", busy, "%"),
            Quantity::new("frames that were learned from", self.adapting.learned() as f64, ""),
            Quantity::new("ticks limited by a region", limited as f64, ""),
            Quantity::new("the same at regions", self.at_regions[1].learned() as f64, ""),
        ]
    }

    /// `suffix` names the rate if there are several.
    fn variants(self, suffix: &str) -> impl Iterator<Item = Variant> + use<> {
        let [lateness, compute] = ["lateness", "compute"].map(|group| format!("{group}{suffix}"));
        let late = LATE.into_iter().zip(self.late);
        let computing = COMPUTING.into_iter().zip(self.computing);
        let of = |group: String| {
            move |((name, role), durations): ((&str, Role), Durations)| {
                Variant::new(name, &group, role, durations)
            }
        };
        late.map(of(lateness)).chain(computing.map(of(compute)))
    }
}

fn measure(
    periods: &[Nanos],
    turns: u32,
    (model, name): (Model, String),
    run: Run,
) -> Result<Found, Failure> {
    let scheduling = vec![run.schedule("loop")];
    let (model, note) = (Arc::new(model), format!("The model of the controller: {name}."));
    let rates = periods.iter().map(|period| Rate::new(*period, &model));
    let mut rates = rates.collect::<Result<Vec<_>, _>>()?;
    for _ in 0..turns {
        for rate in &mut rates {
            run.check()?;
            rate.turns()?;
        }
    }
    let mut quantities: Vec<Quantity> = rates.iter().flat_map(Rate::quantities).collect();
    let spin_us = SPIN.0 as f64 / 1e3;
    quantities.push(Quantity::new("spinning before each tick", spin_us, "us"));
    let is_single = rates.len() == 1;
    let variants = rates.into_iter().flat_map(|rate| {
        let suffix = format!(", {:.0} Hz", rate.ticks_per_s());
        rate.variants(if is_single { "" } else { &suffix })
    });
    Ok(Found { scheduling, variants: variants.collect(), quantities, notes: vec![note] })
}

/// Runs a ticker for one turn: records the lateness of its ticks and calls `work` in each.
fn run_turn(
    period: Nanos,
    spin: Nanos,
    lateness: &mut Durations,
    mut work: impl FnMut() -> Result<(), Failure>,
) -> Result<(), Failure> {
    let start = clock::now();
    let mut ticker = Ticker::new(start + period, period, spin);
    loop {
        let tick = ticker.wait();
        lateness.push(tick.started - tick.planned);
        work()?;
        if tick.started.duration_since(start) > TURN {
            return Ok(());
        }
    }
}

pub const CONFIG: &str = include_str!("../../../config/emulator.toml");
/// The camera: interval and age of its frames, and their offset from the calibration, rad.
const FRAME_INTERVAL: Nanos = Nanos::from_millis(33);
const FRAME_AGE: Nanos = Nanos::from_millis(60);
const SHIFT: [f64; 3] = [0.01, -0.006, 0.0];
/// Range of the motion on both axes, degrees; with regions for the tip, and their distance.
const REACH_DEG: f64 = 5.0;
const REACH_AT_REGIONS_DEG: f64 = 9.0;
const FREE_DEG: f64 = 6.0;

#[derive(Debug)]
struct Cycle {
    control: ClosedLoop<IdealMotors>,
    /// Where the conditioning cycle leaves the snake, rad.
    start: OutputVec,
    seconds: f64,
    reach_deg: f64,
    limited: u64,
    camera: Option<Camera>,
}

#[derive(Debug, Default)]
struct Camera {
    frames: VecDeque<(Nanos, ExternalPose)>,
    next: Nanos,
}

impl Cycle {
    /// An enabled cycle after a conditioning cycle; with adaptation also a camera.
    fn new(
        period: Nanos,
        model: &Arc<Model>,
        at_regions: bool,
        adapts: bool,
    ) -> Result<Self, Failure> {
        let reach_deg = if at_regions { REACH_AT_REGIONS_DEG } else { REACH_DEG };
        let text = if at_regions { format!("{CONFIG}{}", regions()) } else { CONFIG.to_owned() };
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
    fn step(&mut self) -> Result<bool, Failure> {
        self.seconds += self.control.period().as_seconds();
        let external = self.camera.as_mut().and_then(|camera| camera.frame(&self.control));
        let report = self.control.follow_with(self.goal(), external)?;
        self.limited += u64::from(report.limited_by_fixture.is_some());
        Ok(external.is_some())
    }

    /// Two frequencies with a long common period, of at most 5 deg/s, or 9 with regions.
    fn goal(&self) -> ServoGoal {
        let axis = |hz: f64| self.reach_deg.to_radians() * (TAU * hz * self.seconds).sin();
        ServoGoal::Joint([self.start[0] + axis(0.15), self.start[1] + axis(0.093), 0.0], 2)
    }

    fn learned(&self) -> u64 {
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
