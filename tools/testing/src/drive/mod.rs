//! A drive, its line and a configured port in simulated time, with the control loop's ends of axes.

mod line;
mod mini_drive;

use std::slice;
use std::sync::{Arc, Mutex};

use i2ris::config::PortConfig;
use i2ris::drive::capture::file::{from_bytes, to_bytes};
use i2ris::drive::capture::{CapturedPort, LineEvent, Outcome};
use i2ris::drive::event::{PortEvent, PortEventKind};
use i2ris::drive::link::replay::replay;
use i2ris::drive::{AxisFeedback, AxisLink, AxisPhase, AxisRequest};
use i2ris::drive::{Demand, DriveError, Port, PortRunner};
use i2ris::units::{Counts, Nanos};

pub use line::{
    Disturbance, LineState, ReceivedRequest, SERIAL_NUMBER, SimulatedLine, port_config,
};
pub use mini_drive::*;

pub const NODE: u8 = 1;
const LOOP: Nanos = Nanos::from_millis(10);

pub struct PortRig {
    pub line: SimulatedLine,
    pub runner: PortRunner<SimulatedLine>,
    ends: Arc<Mutex<Ends>>,
    pub events: Vec<PortEvent>,
}

struct Ends {
    links: Vec<AxisLink>,
    requests: Vec<AxisRequest>,
}

impl Ends {
    fn write(&mut self) {
        for (link, request) in self.links.iter_mut().zip(&mut self.requests) {
            request.sequence += 1;
            link.requests.write(*request);
        }
    }
}

fn keep_writing(line: &SimulatedLine, ends: &Arc<Mutex<Ends>>, at: Nanos) {
    let (again, all) = (line.clone(), Arc::clone(ends));
    line.plan(at, move || {
        all.lock().unwrap().write();
        keep_writing(&again, &all, at + LOOP);
    });
}

pub fn one_drive() -> MiniDrive {
    MiniDrive::new(NODE, SERIAL_NUMBER)
}

pub fn open(drives: Vec<MiniDrive>) -> (SimulatedLine, PortConfig, Port<SimulatedLine>) {
    let config = port_config(&drives);
    let line = SimulatedLine::new(drives);
    let port = Port::over(line.clone(), &config);
    (line, config, port)
}

pub fn bring_up(drive: MiniDrive) -> (SimulatedLine, Result<(), DriveError>) {
    let (line, _, port) = open(vec![drive]);
    let end = port.bring_up().map(drop);
    (line, end)
}

impl PortRig {
    pub fn new(drives: Vec<MiniDrive>) -> Self {
        Self::with(drives, |_| {})
    }

    /// The configuration of the port is changed first.
    pub fn with(drives: Vec<MiniDrive>, change: impl FnOnce(&mut PortConfig)) -> Self {
        let (line, mut config, _) = open(drives);
        change(&mut config);
        let (runner, links) = Port::over(line.clone(), &config).bring_up().unwrap().split();
        let requests = vec![AxisRequest::default(); links.len()];
        let ends = Arc::new(Mutex::new(Ends { links, requests }));
        keep_writing(&line, &ends, line.time());
        Self { line, runner, ends, events: Vec::new() }
    }

    pub fn disabled() -> Self {
        let mut rig = Self::new(vec![one_drive()]);
        rig.until(AxisPhase::Disabled);
        rig
    }

    /// One drive, enabled at its position of 120 counts.
    pub fn enabled() -> Self {
        let mut rig = Self::disabled();
        rig.drive(|drive| drive.position = 120);
        rig.enable(120);
        rig.until(AxisPhase::Enabled);
        rig.drive(|drive| drive.writes.clear());
        rig.events.clear();
        rig
    }

    pub fn drive<R>(&self, access: impl FnOnce(&mut MiniDrive) -> R) -> R {
        self.line.drive(NODE, access)
    }

    pub fn request(&mut self, change: impl FnOnce(&mut AxisRequest)) {
        self.request_of(0, change);
    }

    pub fn request_of(&mut self, axis: usize, change: impl FnOnce(&mut AxisRequest)) {
        let mut ends = self.ends.lock().unwrap();
        change(&mut ends.requests[axis]);
        ends.write();
    }

    pub fn newest(&self, axis: usize) -> AxisRequest {
        self.ends.lock().unwrap().requests[axis]
    }

    /// Demands a state of every axis at an instant, also in the middle of an exchange.
    pub fn demand_at(&mut self, due: Nanos, demand: Demand) {
        let ends = Arc::clone(&self.ends);
        self.line.plan(due, move || {
            let mut ends = ends.lock().unwrap();
            ends.requests.iter_mut().for_each(|request| request.demand = demand);
            ends.write();
        });
    }

    pub fn demand(&mut self, demand: Demand) {
        self.request(|request| request.demand = demand);
    }

    pub fn demand_until(&mut self, demand: Demand, phase: AxisPhase) {
        self.demand(demand);
        self.until(phase);
    }

    pub fn reconnect_until(&mut self, phase: AxisPhase) {
        self.line.state().silent = false;
        self.until(phase);
    }

    pub fn turns(&mut self, count: usize) {
        for _ in 0..count {
            let events = &mut self.events;
            self.runner.turn(&mut |event| events.push(event));
        }
    }

    pub fn feedback(&mut self) -> AxisFeedback {
        self.feedback_of(0)
    }

    pub fn phase(&mut self) -> AxisPhase {
        self.feedback().phase
    }

    pub fn phases(&mut self) -> [AxisPhase; 2] {
        [0, 1].map(|axis| self.feedback_of(axis).phase)
    }

    pub fn feedback_of(&mut self, axis: usize) -> AxisFeedback {
        *self.ends.lock().unwrap().links[axis].feedback.read()
    }

    pub fn until(&mut self, phase: AxisPhase) {
        self.until_feedback("reaches the phase", |feedback| feedback.phase == phase);
    }

    pub fn until_feedback(&mut self, what: &str, is_true: impl Fn(&AxisFeedback) -> bool) {
        for _ in 0..20_000 {
            self.turns(1);
            if is_true(&self.feedback()) {
                return;
            }
        }
        let feedback = self.feedback();
        panic!("never {what}: {feedback:?}, events {:?}", self.events);
    }

    pub fn shut_down(&mut self) {
        let events = &mut self.events;
        self.runner.shut_down(&mut |event| events.push(event));
    }

    pub fn kinds(&self) -> Vec<PortEventKind> {
        self.events.iter().map(|event| event.kind).collect()
    }

    pub fn has_event(&self, kind: PortEventKind) -> bool {
        self.kinds().contains(&kind)
    }

    pub fn count_events(&self, is_counted: fn(&PortEventKind) -> bool) -> usize {
        self.kinds().iter().filter(|kind| is_counted(kind)).count()
    }

    pub fn enable(&mut self, target: i32) {
        self.request(|request| {
            (request.demand, request.target) = (Demand::Enabled, Counts(target));
        });
    }

    pub fn release_and_enable(&mut self) {
        self.demand(Demand::Disabled);
        self.turns(2);
        self.demand_until(Demand::Enabled, AxisPhase::Enabled);
    }

    pub fn start_homing(&mut self) {
        self.request(|request| request.homings += 1);
    }

    pub fn state(&self) -> u16 {
        self.drive(|drive| drive.state)
    }

    pub fn controlwords(&self) -> Vec<u32> {
        self.drive(|drive| drive.written(0x6040, 0))
    }
}

/// Frames of requests and replies, and the number of outcomes without an answer, all replayed.
pub fn replayed(port: &CapturedPort) -> (u64, usize) {
    let file = from_bytes(&to_bytes(slice::from_ref(port), "test", Nanos::ZERO)).unwrap();
    assert_eq!(file.ports, slice::from_ref(port));
    let found = replay(port);
    assert!(found.differences.is_empty() && found.skipped == 0, "{found:?}");
    let outcomes = port.events.iter().filter_map(LineEvent::outcome);
    let failures = outcomes.filter(|it| !matches!(it, Outcome::Answered(_))).count();
    (2 * found.attempts, failures)
}
