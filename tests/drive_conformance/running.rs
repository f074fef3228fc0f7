//! A port thread at work, and the control loop's end of the axis under test.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread::{JoinHandle, sleep, spawn};
use std::time::{Duration, Instant};

use i2ris::drive::{
    AxisFeedback, AxisLink, AxisPhase, AxisRequest, Configured, Demand, Port, PortEvent,
    PortEventKind,
};

use super::bench::PATIENCE;

/// A port thread, and the control loop's end of its axis.
pub struct Running {
    link: AxisLink,
    /// The ends of the other axes of the port.
    _others: Vec<AxisLink>,
    pub request: AxisRequest,
    stop: Arc<AtomicBool>,
    abandoned: Arc<AtomicBool>,
    events: Receiver<PortEvent>,
    thread: Option<JoinHandle<()>>,
}

impl Running {
    pub fn start(port: Port<Configured>, motor: usize) -> Self {
        let (mut runner, links) = port.split();
        let (stop, abandoned) = (
            Arc::new(AtomicBool::new(false)),
            Arc::new(AtomicBool::new(false)),
        );
        let (sender, events) = channel();
        let (stopped, left) = (Arc::clone(&stop), Arc::clone(&abandoned));
        let thread = spawn(move || {
            let mut tell = |event: PortEvent| {
                if event.motor == motor {
                    sender.send(event).unwrap_or_default();
                }
            };
            runner.announce(&mut tell);
            while !stopped.load(Ordering::Acquire) && !left.load(Ordering::Acquire) {
                runner.turn(&mut tell);
            }
            if !left.load(Ordering::Acquire) {
                runner.shut_down(&mut tell);
            }
        });
        let mut others = links;
        let place = others.iter().position(|link| link.motor == motor).unwrap();
        let link = others.remove(place);
        let mut running = Self {
            link,
            _others: others,
            request: AxisRequest::default(),
            stop,
            abandoned,
            events,
            thread: Some(thread),
        };
        running.until("has started", |feedback| {
            feedback.phase != AxisPhase::Starting
        });
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

    pub fn until(&mut self, what: &str, holds: impl Fn(&AxisFeedback) -> bool) {
        let start = Instant::now();
        while !holds(&self.feedback()) {
            assert!(
                start.elapsed() < PATIENCE,
                "never {what}: {:?} {:?}",
                self.feedback(),
                self.kinds()
            );
            sleep(Duration::from_millis(1));
        }
    }

    pub fn until_phase(&mut self, phase: AxisPhase) {
        self.until("reaches the phase", |feedback| feedback.phase == phase);
    }

    /// Demands disabled, and waits until the port thread has seen it: it reads the newest request
    /// only, and one that is overwritten at once was never there.
    pub fn disable(&mut self) {
        self.request(|request| request.demand = Demand::Disabled);
        let seen = self.feedback().sequence + 2;
        self.until("goes on reading", |feedback| feedback.sequence >= seen);
        self.until_phase(AxisPhase::Disabled);
    }

    /// Demands enabled, with the target where the motor stands.
    pub fn enable(&mut self) {
        let position = self.feedback().position;
        self.request(|request| {
            request.demand = Demand::Enabled;
            request.target = position;
        });
        self.until_phase(AxisPhase::Enabled);
    }

    /// Lets the motor move to a target, a little at a time.
    pub fn move_to(&mut self, target: i32) {
        while self.request.target.0 != target {
            let step = (target - self.request.target.0).clamp(-2, 2);
            self.request(|request| request.target.0 += step);
            sleep(Duration::from_millis(1));
        }
        self.until("arrives", |feedback| {
            (feedback.position.0 - target).abs() <= 2
        });
    }

    /// What `kill -9` leaves behind: the port is free, the drive goes on.
    pub fn abandon(mut self) {
        self.abandoned.store(true, Ordering::Release);
        self.thread.take().unwrap().join().unwrap();
    }

    pub fn kinds(&self) -> Vec<PortEventKind> {
        self.events.try_iter().map(|event| event.kind).collect()
    }

    /// Ends the thread; what it reported that no one looked at yet.
    pub fn stop(&mut self) -> Vec<PortEventKind> {
        self.stop.store(true, Ordering::Release);
        self.thread.take().unwrap().join().unwrap();
        self.kinds()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
