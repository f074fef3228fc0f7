//! The state that the stages share: ports, motors, operator and record.

use std::{collections::BTreeMap, fs, mem, path::Path, rc::Rc};

use i2ris::config::{AxisConfig, Config, PortConfig};
use i2ris::drive::capture::{Capture, CapturedLine, CapturedPort};
use i2ris::drive::{DriveError, capture::file::to_bytes, error::AxisError};
use i2ris::drive::{family_selection::family_of_port, link::DriveLink, transport::Transport};
use i2ris::{clock, robot::DriveFingerprint, units::Nanos, wall_clock};
use i2ris_report::{Failure, files};

use super::node::Node;
use super::record::{Record, Stage, Topic};
use super::watch::PowerCutReason;
use crate::procedure::{Gone, Halt, Permission, Person};

/// Source of the lines, and of processes next to the commissioning.
pub trait Lines {
    type Line: Transport;

    fn open(&mut self, number: usize, port: &PortConfig) -> Result<Self::Line, DriveError>;

    /// Kills a controller that holds the drives; returns the log of the stop. The ports are free.
    fn kill_controller(&mut self) -> Result<String, Failure>;
}

impl From<PowerCutReason> for Halt {
    fn from(trip: PowerCutReason) -> Self {
        match trip {
            PowerCutReason::Interrupted => Self::Gone(Gone::Interrupted),
            trip => trip.to_string().into(),
        }
    }
}

impl From<AxisError> for Halt {
    fn from(error: AxisError) -> Self {
        error.to_string().into()
    }
}

impl From<DriveError> for Halt {
    fn from(error: DriveError) -> Self {
        error.to_string().into()
    }
}

pub struct OpenPort<T> {
    pub config: PortConfig,
    pub link: DriveLink<CapturedLine<T>>,
    pub capture: Capture,
}

pub type Keep<'a> = dyn FnMut(&Record, Stage, &[CapturedPort]) -> Result<(), Failure> + 'a;

pub struct Motor<'a, T> {
    pub place: String,
    pub node: Node<'a, CapturedLine<T>>,
    pub record: &'a mut Record,
    pub person: &'a mut dyn Person,
    pub origin: &'a mut Option<i32>,
}

impl<T> Motor<'_, T> {
    pub fn find(&mut self, topic: Topic, value: &str, evidence: String) {
        self.record.find(topic, &self.place, value, evidence);
    }

    pub fn skip(&mut self, topic: Topic, why: &str) {
        self.record.skip(topic, &self.place, why);
    }
}

pub struct Session<'a, L: Lines> {
    pub config: &'a Config,
    pub lines: &'a mut L,
    pub person: &'a mut dyn Person,
    pub interrupted: Rc<dyn Fn() -> bool>,
    pub record: Record,
    pub ports: Vec<OpenPort<L::Line>>,
    pub device: Option<DriveFingerprint>,
    pub exchanges: usize,
    pub origins: BTreeMap<usize, Option<i32>>,
    pub keep: &'a mut Keep<'a>,
    /// Captured bytes of lines closed since, and the time up to which they are complete.
    pub closed: Vec<CapturedPort>,
    pub kept: Nanos,
}

impl<L: Lines> Session<'_, L> {
    pub fn close(&mut self) {
        self.closed.extend(self.ports.drain(..).map(|port| port.capture.read()));
    }

    pub fn take_captured(&mut self) -> Vec<CapturedPort> {
        let mut all = mem::take(&mut self.closed);
        all.extend(self.ports.iter().map(|port| port.capture.read()));
        let (kept, events) = (self.kept, all.iter().flat_map(|port| &port.events));
        self.kept = events.map(|event| event.time).max().unwrap_or(kept);
        all.iter_mut().for_each(|port| port.events.retain(|event| event.time > kept));
        all
    }

    pub fn open(&mut self) -> Result<(), DriveError> {
        for (number, config) in self.config.ports.iter().enumerate() {
            let line = self.lines.open(number, config)?;
            let (line, capture) = CapturedLine::new(line, config);
            let link = DriveLink::new(line, family_of_port(config), config);
            self.ports.push(OpenPort { config: config.clone(), link, capture });
        }
        Ok(())
    }

    pub fn each_motor(
        &mut self,
        yes: &Permission,
        act: fn(&mut Motor<'_, L::Line>, &Permission) -> Result<String, Halt>,
    ) -> Result<String, Halt> {
        let mut texts = Vec::new();
        for port in 0..self.ports.len() {
            for axis in 0..self.ports[port].config.axes.len() {
                let mut motor = self.motor(port, axis);
                let text = act(&mut motor, yes).map_err(|halt| halt.at(&motor.place))?;
                texts.push(format!("{}: {text}", motor.place));
            }
        }
        Ok(texts.join("; "))
    }

    pub fn motor(&mut self, port: usize, axis: usize) -> Motor<'_, L::Line> {
        let OpenPort { config, link, .. } = &mut self.ports[port];
        let axis: &AxisConfig = &config.axes[axis];
        Motor {
            place: format!("motor {}", axis.motor),
            node: Node::new(link, config, axis, &*self.interrupted),
            record: &mut self.record,
            person: self.person,
            origin: self.origins.entry(axis.motor).or_default(),
        }
    }
}

pub fn keep(
    folder: &Path,
    record: &Record,
    stage: Stage,
    captured: &[CapturedPort],
) -> Result<(), Failure> {
    record.save(folder)?;
    let path = folder.join(format!("{stage}.pcapng"));
    if captured.iter().all(|port| port.events.is_empty()) {
        // Remove the capture of an earlier run.
        let _ = fs::remove_file(path);
        return Ok(());
    }
    let wall_offset = wall_clock::unix_time() - clock::now();
    Ok(files::write(&path, to_bytes(captured, &record.software, wall_offset))?)
}

pub fn ms(span: Nanos) -> String {
    format!("{:.1} ms", span.as_seconds() * 1e3)
}
