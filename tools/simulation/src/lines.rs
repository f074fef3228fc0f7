//! Serial lines with emulated drives in simulated time: the port threads of the controller against
//! drives, with the timing of a line. The computing time of the machine is not included.
//!
//! Every port has its thread. Only the one with the earliest instant runs: every run is the same.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError, mpsc};
use std::thread::{self, JoinHandle};
use std::{io, mem};

use i2ris::config::PortConfig;
use i2ris::core::{CycleOutputs, Gated};
use i2ris::drive::transport::Transport;
use i2ris::drive::{AxisFeedback, AxisLink, Port};
use i2ris::units::{AUXILIARY, Counts, MAX_AXES, MAX_MOTORS, MotorVec, Nanos};

use crate::closed_loop::Motors;
use crate::drive::Drive;
use crate::drive::frame::{self, Parser};
use crate::emulator::config::EmulatorConfig;
use crate::emulator::log::lock;
use crate::emulator::log::{Event, Log};
use crate::emulator::plant::Plant;
use crate::emulator::port::LineTiming;

/// The first tick. Every drive is brought up long before it.
const BEGIN: Nanos = Nanos::from_millis(60_000);
/// Maximum step of time without a request.
const SLEEP_STEP: Nanos = Nanos::from_millis(1000);

/// The present instant of every thread. The control loop is the first.
#[derive(Debug, Clone)]
struct Instants(Arc<(Mutex<Vec<Nanos>>, Condvar)>);

impl Instants {
    /// Lets time pass for a thread: returns as soon as it is the earliest.
    fn wait(&self, thread: usize, until: Nanos) {
        let (instants, changed) = &*self.0;
        let mut all = instants.lock().unwrap_or_else(PoisonError::into_inner);
        all[thread] = all[thread].max(until);
        changed.notify_all();
        let is_later = |all: &mut Vec<Nanos>| {
            all.iter().enumerate().any(|(other, at)| (*at, other) < (all[thread], thread))
        };
        drop(changed.wait_while(all, is_later));
    }

    /// Removes a thread that ends.
    fn leave(&self, thread: usize) {
        self.wait(thread, Nanos(0));
        let mut all = self.0.0.lock().unwrap_or_else(PoisonError::into_inner);
        all[thread] = Nanos(u64::MAX);
        self.0.1.notify_all();
    }
}

/// The controller's end of a line, with the drive.
struct LineEnd {
    plant: Arc<Mutex<Plant>>,
    instants: Instants,
    thread: usize,
    /// Axis of the drive with the port.
    axis: usize,
    now: Nanos,
    timing: LineTiming,
    parser: Parser,
    /// The reply, and when it arrives.
    reply: Option<(Nanos, Vec<u8>)>,
}

impl LineEnd {
    fn new(
        config: &EmulatorConfig,
        plant: &Arc<Mutex<Plant>>,
        instants: &Instants,
        [thread, axis]: [usize; 2],
    ) -> Self {
        Self {
            plant: Arc::clone(plant),
            instants: instants.clone(),
            thread,
            axis,
            now: Nanos::ZERO,
            timing: LineTiming::new(&config.line, config.seed + axis as u64),
            parser: Parser::default(),
            reply: None,
        }
    }

    fn pass(&mut self, until: Nanos) {
        self.now = self.now.max(until);
        self.instants.wait(self.thread, self.now);
    }
}

impl Transport for LineEnd {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let (read, mut incoming) = (self.now, None);
        self.timing.wait_for_frame(read);
        for byte in bytes {
            self.timing.arrive(read);
            incoming = self.parser.push(*byte).or(incoming);
        }
        let Some(incoming) = incoming else { return Ok(()) };
        let arrived = self.timing.complete(read);
        self.instants.wait(self.thread, arrived);
        let Some(reply) = lock(&self.plant).reply(self.axis, &incoming, arrived) else {
            return Ok(());
        };
        let bytes = frame::reply(&reply.data);
        let ready = self.timing.process(arrived, reply.delay);
        self.reply = Some((self.timing.reply(ready, bytes.len()), bytes));
        Ok(())
    }

    fn read(&mut self, into: &mut [u8], deadline: Nanos) -> io::Result<usize> {
        match self.reply.take_if(|(due, _)| *due <= deadline) {
            Some((due, bytes)) => {
                self.pass(due);
                into[..bytes.len()].copy_from_slice(&bytes);
                Ok(bytes.len())
            }
            None => {
                self.pass(deadline);
                Ok(0)
            }
        }
    }

    fn now(&self) -> Nanos {
        self.now
    }

    fn sleep_until(&mut self, until: Nanos) {
        self.pass(until);
    }
}

/// Lines with their drives and the snake.
#[derive(Debug)]
pub struct Lines {
    plant: Arc<Mutex<Plant>>,
    log: Arc<Log>,
    instants: Instants,
    links: Vec<AxisLink<Gated>>,
    feedback: [AxisFeedback; MAX_AXES],
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Lines {
    /// Brings up all drives on the ports of the controller. The error is the reason for a failure.
    pub fn start(config: &EmulatorConfig, ports: &[PortConfig]) -> Result<Self, String> {
        let (plant, log) = plant(config);
        let mut instants = vec![Nanos::ZERO; ports.len() + 1];
        instants[0] = BEGIN;
        let instants = Instants(Arc::new((Mutex::new(instants), Condvar::new())));
        let (stop, (ready, links)) = (Arc::new(AtomicBool::new(false)), mpsc::channel());
        let mut threads = Vec::new();
        for (index, port) in ports.iter().enumerate() {
            let end = LineEnd::new(config, &plant, &instants, [index + 1, index]);
            let (port, ready, stop) = (port.clone(), ready.clone(), Arc::clone(&stop));
            threads.push(thread::spawn(move || serve(end, &port, &ready, &stop)));
        }
        let mut lines = Self {
            plant,
            log,
            instants,
            links: Vec::new(),
            feedback: [AxisFeedback::default(); MAX_AXES],
            stop,
            threads,
        };
        for found in links.iter().take(ports.len()) {
            lines.links.extend(found?);
        }
        Ok(lines)
    }

    /// True positions of the motors, counts.
    pub fn motors(&self) -> MotorVec {
        let plant = lock(&self.plant);
        [0, 1].map(|motor| plant.drives[motor].motor_counts())
    }

    /// Events of the drives.
    pub fn events(&self) -> Vec<Event> {
        self.log.events()
    }

    /// Requests that were answered, on the line of each axis.
    pub fn exchanges(&self) -> [u64; MAX_AXES] {
        self.feedback.map(|feedback| feedback.counters.exchanges)
    }
}

/// The thread of a port.
fn serve(
    mut end: LineEnd,
    port: &PortConfig,
    ready: &mpsc::Sender<Result<Vec<AxisLink<Gated>>, String>>,
    stop: &AtomicBool,
) {
    let (instants, thread) = (end.instants.clone(), end.thread);
    end.pass(Nanos::from_millis(1));
    match Port::over(end, port).bring_up() {
        Ok(port) => {
            let (runner, links) = port.split();
            let _ = ready.send(Ok(links));
            instants.wait(thread, BEGIN);
            runner.run(stop, |_| {});
        }
        Err(error) => drop(ready.send(Err(error.to_string()))),
    }
    instants.leave(thread);
}

impl Motors for Lines {
    fn begin(&self) -> Nanos {
        BEGIN
    }

    fn feedback(&mut self, now: Nanos) -> Option<[AxisFeedback; MAX_AXES]> {
        self.instants.wait(0, now);
        lock(&self.plant).advance_to(now);
        for link in &mut self.links {
            self.feedback[link.motor] = *link.feedback.read();
        }
        Some(self.feedback)
    }

    fn read(&mut self, _targets: [Option<Counts>; MAX_MOTORS]) -> MotorVec {
        [0, 1].map(|motor| self.feedback[motor].position.as_f64())
    }

    fn request(&mut self, outputs: &CycleOutputs) {
        for link in &mut self.links {
            let request = match link.motor {
                AUXILIARY => outputs.auxiliary.as_ref(),
                motor => outputs.requests.get(motor),
            };
            if let Some(request) = request {
                link.requests.write(*request);
            }
        }
    }

    fn angles_deg(&self) -> Option<[f64; 2]> {
        Some(lock(&self.plant).snake.angles_deg())
    }
}

impl Drop for Lines {
    /// Ends the threads and switches the drives off.
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        self.instants.leave(0);
        for thread in mem::take(&mut self.threads) {
            let _ = thread.join();
        }
    }
}

fn plant(config: &EmulatorConfig) -> (Arc<Mutex<Plant>>, Arc<Log>) {
    let log = Arc::<Log>::default();
    let plant = Plant::new(config, Arc::clone(&log), Nanos::ZERO);
    (Arc::new(Mutex::new(plant)), log)
}

/// Lines that one thread uses in turn, without port threads. The motors do not move the snake.
#[derive(Clone)]
pub struct Bench {
    plant: Arc<Mutex<Plant>>,
    config: EmulatorConfig,
}

impl Bench {
    pub fn new(config: &EmulatorConfig) -> Self {
        let (plant, _) = plant(config);
        lock(&plant).wires.iter_mut().for_each(|wire| wire.break_at(0.0));
        Self { plant, config: config.clone() }
    }

    pub fn line(&self, port: usize) -> BenchLine {
        let axis = self.config.ports().get(port).and_then(|axes| axes.first().copied());
        let instants = Instants(Arc::new((Mutex::new(vec![Nanos::ZERO]), Condvar::new())));
        BenchLine(LineEnd::new(&self.config, &self.plant, &instants, [0, axis.unwrap_or(port)]))
    }

    /// Inspects or changes a drive.
    pub fn with_drive<R>(&self, axis: usize, act: impl FnOnce(&mut Drive) -> R) -> R {
        act(&mut lock(&self.plant).drives[axis])
    }
}

/// The end of such a line. All lines have the time of the drives.
pub struct BenchLine(LineEnd);

impl Transport for BenchLine {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.now = self.now();
        self.0.write(bytes)
    }

    fn read(&mut self, into: &mut [u8], deadline: Nanos) -> io::Result<usize> {
        self.0.read(into, deadline)
    }

    fn now(&self) -> Nanos {
        self.0.now.max(lock(&self.0.plant).time)
    }

    fn sleep_until(&mut self, until: Nanos) {
        // Small steps, so that the plant catches up.
        while self.now() + SLEEP_STEP < until {
            self.0.now = self.now() + SLEEP_STEP;
            lock(&self.0.plant).advance_to(self.0.now);
        }
        self.0.now = self.now().max(until);
    }
}
