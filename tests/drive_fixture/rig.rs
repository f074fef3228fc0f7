//! A configured port on the bench, with the control loop's ends of its axes.

use i2ris::config::PortConfig;
use i2ris::drive::event::{PortEvent, PortEventKind};
use i2ris::drive::{
    AxisFeedback, AxisLink, AxisPhase, AxisRequest, Demand, DriveError, Opened, Port, PortRunner,
};
use i2ris::units::Counts;

use super::{Bench, MiniDrive, SERIAL_NUMBER, port_config};

pub const NODE: u8 = 1;

pub struct Rig {
    pub bench: Bench,
    pub runner: PortRunner<Bench>,
    pub links: Vec<AxisLink>,
    pub requests: Vec<AxisRequest>,
    pub events: Vec<PortEvent>,
}

/// One drive behind the port.
pub fn one_drive() -> MiniDrive {
    MiniDrive::new(NODE, SERIAL_NUMBER)
}

pub fn open(drives: Vec<MiniDrive>) -> (Bench, PortConfig, Port<Opened, Bench>) {
    let config = port_config(&drives);
    let bench = Bench::new(drives);
    let port = Port::over(bench.clone(), &config);
    (bench, config, port)
}

pub fn bring_up(drive: MiniDrive) -> (Bench, Result<(), DriveError>) {
    let (bench, _, port) = open(vec![drive]);
    let end = port.bring_up().map(drop);
    (bench, end)
}

impl Rig {
    pub fn new(drives: Vec<MiniDrive>) -> Self {
        let (bench, _, port) = open(drives);
        let (runner, links) = port.bring_up().unwrap().split();
        let requests = vec![AxisRequest::default(); links.len()];
        Self {
            bench,
            runner,
            links,
            requests,
            events: Vec::new(),
        }
    }

    /// One drive, found disabled.
    pub fn disabled() -> Self {
        let mut rig = Self::new(vec![one_drive()]);
        rig.until(AxisPhase::Disabled);
        rig
    }

    /// One drive, enabled where it stands: at 120 counts.
    pub fn enabled() -> Self {
        let mut rig = Self::disabled();
        rig.drive(|drive| drive.position = 120);
        rig.request(|request| {
            request.demand = Demand::Enabled;
            request.target = Counts(120);
        });
        rig.until(AxisPhase::Enabled);
        rig.drive(|drive| drive.writes.clear());
        rig.events.clear();
        rig
    }

    pub fn drive<R>(&self, look: impl FnOnce(&mut MiniDrive) -> R) -> R {
        self.bench.drive(NODE, look)
    }

    /// Changes the request of the first axis and sends it.
    pub fn request(&mut self, change: impl FnOnce(&mut AxisRequest)) {
        self.request_of(0, change);
    }

    pub fn request_of(&mut self, axis: usize, change: impl FnOnce(&mut AxisRequest)) {
        change(&mut self.requests[axis]);
        self.requests[axis].sequence += 1;
        self.links[axis].requests.write(self.requests[axis]);
    }

    pub fn demand(&mut self, demand: Demand) {
        self.request(|request| request.demand = demand);
    }

    pub fn turns(&mut self, count: usize) {
        for _ in 0..count {
            let events = &mut self.events;
            self.runner.turn(&mut |event| events.push(event));
        }
    }

    pub fn feedback(&mut self) -> AxisFeedback {
        *self.links[0].feedback.read()
    }

    pub fn feedback_of(&mut self, axis: usize) -> AxisFeedback {
        *self.links[axis].feedback.read()
    }

    /// Turns until the first axis is in a phase.
    pub fn until(&mut self, phase: AxisPhase) {
        self.until_it("reaches the phase", |feedback| feedback.phase == phase);
    }

    pub fn until_it(&mut self, what: &str, holds: impl Fn(&AxisFeedback) -> bool) {
        for _ in 0..20_000 {
            self.turns(1);
            if holds(&self.feedback()) {
                return;
            }
        }
        panic!(
            "never {what}: {:?}, events {:?}",
            self.feedback(),
            self.events
        );
    }

    pub fn shut_down(&mut self) {
        let events = &mut self.events;
        self.runner.shut_down(&mut |event| events.push(event));
    }

    pub fn kinds(&self) -> Vec<PortEventKind> {
        self.events.iter().map(|event| event.kind).collect()
    }

    /// Controlwords that were written.
    pub fn controlwords(&self) -> Vec<u32> {
        self.drive(|drive| drive.written(0x6040, 0))
    }
}
