//! A running port thread, and the control loop's end of the axis under test.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::thread::{JoinHandle, sleep, spawn};
use std::time::{Duration, Instant};

use super::*;

/// A port thread, and the control loop's end of its axis.
pub struct RunningAxis {
    link: AxisLink,
    /// The ends of the other axes of the port.
    _others: Vec<AxisLink>,
    pub request: AxisRequest,
    stop: Arc<AtomicBool>,
    abandoned: Arc<AtomicBool>,
    events: Receiver<PortEvent>,
    thread: Option<JoinHandle<()>>,
}

impl RunningAxis {
    pub fn start(port: ReadyPort, motor: usize) -> Self {
        let (mut runner, mut links) = port.split();
        let [stop, abandoned] = [(); 2].map(|()| Arc::new(AtomicBool::new(false)));
        let (sender, events) = channel();
        let (stopped, left) = (Arc::clone(&stop), Arc::clone(&abandoned));
        let thread = spawn(move || {
            let mut report = |event: PortEvent| {
                if event.motor == motor {
                    sender.send(event).unwrap_or_default();
                }
            };
            runner.report_ready(&mut report);
            while !stopped.load(Ordering::Acquire) && !left.load(Ordering::Acquire) {
                runner.turn(&mut report);
            }
            if !left.load(Ordering::Acquire) {
                runner.shut_down(&mut report);
            }
        });
        let link = links.remove(links.iter().position(|link| link.motor == motor).unwrap());
        let mut running = Self {
            link,
            _others: links,
            request: AxisRequest::default(),
            stop,
            abandoned,
            events,
            thread: Some(thread),
        };
        running.until("has started", |feedback| feedback.phase != AxisPhase::Starting);
        running
    }

    pub fn request(&mut self, change: impl FnOnce(&mut AxisRequest)) {
        change(&mut self.request);
        self.request.sequence += 1;
        self.link.requests.write(self.request);
    }

    pub fn feedback(&mut self) -> AxisFeedback {
        *self.link.feedback.read()
    }

    pub fn until(&mut self, what: &str, is_true: impl Fn(&AxisFeedback) -> bool) {
        let start = Instant::now();
        while !is_true(&self.feedback()) {
            if start.elapsed() > PATIENCE {
                panic!("never {what}: {:?} {:?}", self.feedback(), self.kinds());
            }
            sleep(Duration::from_millis(1));
            // As the control loop does in every tick.
            self.request(|_| {});
        }
    }

    pub fn until_phase(&mut self, phase: AxisPhase) {
        self.until("reaches the phase", |feedback| feedback.phase == phase);
    }

    /// Waits until this many more positions were read.
    pub fn wait_for_positions(&mut self, count: u64) {
        let sequence = self.feedback().sequence + count;
        self.until("reads positions", |feedback| feedback.sequence >= sequence);
    }

    pub fn demand(&mut self, demand: Demand) {
        self.request(|request| request.demand = demand);
    }

    /// Demands disabled and waits for the port thread, which reads only the newest request.
    pub fn disable(&mut self) {
        self.demand(Demand::Disabled);
        self.wait_for_positions(2);
        self.until_phase(AxisPhase::Disabled);
    }

    /// Demands quick stop, and waits for it.
    pub fn quick_stop(&mut self) {
        self.demand(Demand::QuickStop);
        self.until_phase(AxisPhase::QuickStopped);
    }

    /// Requests the next homing, and waits until the axis is homed and disabled.
    pub fn home(&mut self) {
        self.request(|request| request.homings += 1);
        let count = self.request.homings;
        self.until("is homed", |feedback| {
            feedback.homings == count && feedback.homed && feedback.phase == AxisPhase::Disabled
        });
    }

    /// Waits for a fault with this error code.
    pub fn until_fault(&mut self, code: u16) {
        self.until("faults", |feedback| {
            feedback.phase == AxisPhase::Faulted && feedback.error_code == code
        });
    }

    /// Demands enabled, with the position of the motor as target.
    pub fn enable(&mut self) {
        let position = self.feedback().position;
        self.request(|request| {
            request.demand = Demand::Enabled;
            request.target = position;
        });
        self.until_phase(AxisPhase::Enabled);
    }

    /// Moves the motor to a target in small steps.
    pub fn move_to(&mut self, target: i32) {
        while self.request.target.0 != target {
            let step = (target - self.request.target.0).clamp(-2, 2);
            self.request(|request| request.target.0 += step);
            sleep(Duration::from_millis(1));
        }
        self.until("arrives", |feedback| (feedback.position.0 - target).abs() <= 2);
    }

    /// Leaves the state of a `kill -9`: the port is free, the drive stays enabled.
    pub fn abandon(mut self) {
        self.abandoned.store(true, Ordering::Release);
        self.thread.take().unwrap().join().unwrap();
    }

    pub fn kinds(&self) -> Vec<PortEventKind> {
        self.events.try_iter().map(|event| event.kind).collect()
    }

    /// Ends the thread; returns the events that were not read yet.
    pub fn stop(&mut self) -> Vec<PortEventKind> {
        self.stop.store(true, Ordering::Release);
        self.thread.take().unwrap().join().unwrap();
        self.kinds()
    }
}

impl Drop for RunningAxis {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
