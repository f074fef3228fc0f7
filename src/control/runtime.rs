//! The controller process: brings everything up in order, runs the threads, takes everything down
//! in order.
//!
//! | thread | scheduling | does |
//! |---|---|---|
//! | control loop | SCHED_FIFO, pinned if asked | one cycle per tick |
//! | one per serial port | SCHED_FIFO, 10 below | the exchanges with the drives |
//! | shared memory | normal | commands in, ticks out |
//! | models | normal | reads, checks and compares models, frees them |
//! | black box | normal | keeps the last seconds of every tick and writes them down |
//! | main | normal | the log, and waiting for the end |

use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::thread::{self, JoinHandle};

use rtrb::Consumer;

use super::audit::{Audit, Run};
use super::black_box::{Recorder, RecorderEnds, TickRecord, Wish, Written};
use super::chronicle::{Known, SharedChronicle};
use super::convert::Identity;
use super::cycle::Cycle;
use super::keeper::{Answer, Keeper, Question};
use super::lane::{LoopEnds, Record, RelayEnds, lanes};
use super::relay::{Desk, Relay};
use super::{Event, EventKind, Inputs};
use crate::COMMIT;
use crate::access::{self, Untrusted};
use crate::clock;
use crate::config::{Config, ControlConfig};
use crate::drive::error::DriveError;
use crate::drive::event::{PortEvent, PortEventKind};
use crate::drive::port::{Opened, Port};
use crate::drive::port_runner::{AxisLink, PortRunner};
use crate::drive::{AxisFeedback, AxisIdentity};
use crate::ipc::pulse::Pulse;
use crate::ipc::server::RELAY_LEAD;
use crate::ipc::{Domain, DomainError, DomainGuard, IpcError, OperatingState, Server, look_up};
use crate::model::{Model, ModelError};
use crate::rt::{self, Granted, TickTiming, Ticker, Wanted};
use crate::units::{MAX_MOTORS, Nanos};

/// How far the SCHED_FIFO priority of the port threads lies below that of the loop.
const PORT_PRIORITY_DISTANCE: u8 = 10;
/// When the first tick is due after the threads were asked to start.
const START_DELAY: Nanos = Nanos::from_millis(20);
/// How long the port threads may take to read the first positions: a few exchanges, unless the
/// machine stalls.
const FIRST_POSITIONS: Nanos = Nanos::from_millis(2000);
/// How often the log is written.
const LOG_PERIOD: Nanos = Nanos::from_millis(20);

/// Why the controller could not start, or ended badly.
#[derive(Debug, thiserror::Error)]
pub enum RuntimeError {
    /// Everyone may write the model.
    #[error("model file {0}")]
    Untrusted(#[from] Untrusted),
    /// The model is missing, damaged, or of another robot.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The domain is taken or cannot be used.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// Shared memory does not come up.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// A port or a drive does not come up.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// The system refuses a thread.
    #[error(
        "cannot start the thread {name}: {source}; the limit on processes of this user may be too low"
    )]
    Thread {
        /// Which one.
        name: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// A thread panicked. The drives were brought to rest as far as their own threads still ran.
    #[error("internal error: the thread {0} ended early; the robot was stopped")]
    Died(&'static str),
}

/// Runs the controller until `shutdown` is set and the drives are off. Lines for a person go to
/// `log`.
///
/// # Errors
///
/// When something does not come up, or a thread ended early.
pub fn run(
    config: &Config,
    shutdown: &Arc<AtomicBool>,
    log: &mut dyn Write,
) -> Result<(), RuntimeError> {
    run_with_note(config, "", shutdown, log)
}

/// The same with what the operator has to say about this run, for the log of runs.
///
/// # Errors
///
/// As [`run`].
pub fn run_with_note(
    config: &Config,
    note: &str,
    shutdown: &Arc<AtomicBool>,
    log: &mut dyn Write,
) -> Result<(), RuntimeError> {
    let model = load_model(config)?.map(Arc::new);
    // The lock comes before the ports: a second controller must not touch the drives of the first.
    let domain = Domain::new(&config.ipc.domain)?;
    let guard = DomainGuard::acquire(&domain)?;
    let (boot_id, first_model) = (guard.boot_id(), model.as_ref().map(|model| model.id()));
    let Drives {
        runners,
        mut links,
        found,
    } = bring_up_ports(config)?;
    let (recorder, recorder_ends) =
        Recorder::new(config, model.as_ref(), &software(), guard.boot_id());
    let (mut loop_ends, relay_ends, keeper_ends, events) = lanes(recorder_ends);
    let quit = Arc::new(AtomicBool::new(false));
    let chronicle = chronicle(config, model.as_ref());
    let (questions, questions_out) = mpsc::channel();
    let (answers_in, answers) = mpsc::channel();
    let (wishes, wishes_out) = mpsc::channel();
    let (written_in, written) = mpsc::channel();
    let (lines_in, lines) = mpsc::channel();
    let recorder = Thread::recorder(config, recorder, wishes_out, written_in, lines_in, &quit)?;
    let keeper = Keeper::new(
        config.clone(),
        chronicle.clone(),
        keeper_ends,
        wishes.clone(),
    );
    let keeper = Thread::keeper(config, keeper, questions_out, answers_in, &quit)?;

    let (granted_in, granted_out) = mpsc::channel();
    let desk = Desk {
        questions,
        answers,
        wishes,
        written,
    };
    let (relay, pulse) = Thread::relay(
        config,
        guard,
        relay_ends,
        chronicle,
        desk,
        granted_out,
        &quit,
    )?;
    loop_ends.pulse = Some(pulse);
    let (port_events_in, port_events) = mpsc::channel();
    let ports = runners
        .into_iter()
        .map(|runner| Thread::port(config, runner, port_events_in.clone(), &quit))
        .collect::<Result<Vec<_>, _>>()?;
    wait_for_positions(&mut links);
    let first = clock::now() + START_DELAY;
    let cycle = Cycle::new(config, model);
    let (told_in, told) = mpsc::channel();
    let control = Thread::control(
        &config.control,
        cycle,
        loop_ends,
        links,
        first,
        told_in,
        shutdown,
    )?;
    let mut rights = Granted::default();
    if let Ok(granted) = told.recv() {
        // A relay that is gone already is noticed right below. It comes first: a log that nobody
        // reads may block.
        let _ = granted_in.send((granted.clone(), first));
        tell_granted(log, &granted);
        rights = granted;
    }
    let software = software();
    let drives = &found;
    let run = Run {
        software: &software,
        boot_id,
        config,
        model: first_model,
        drives,
        granted: &rights,
        note,
    };
    let (audit, begun) = Audit::begin(&run);
    begun.unwrap_or_else(|error| {
        say(
            log,
            format_args!("warning: the log of runs is not written: {error}"),
        )
    });

    let mut watch = Watch {
        events,
        port_events,
        lines,
        audit,
        domain,
        boot_id,
        log,
    };
    watch.until_end(&control, &[&relay, &keeper, &recorder], &ports, shutdown);
    let control = control.join();
    quit.store(true, Ordering::Release);
    let others = ports
        .into_iter()
        .map(Thread::join)
        .chain([relay.join(), keeper.join(), recorder.join()])
        .collect::<Result<Vec<()>, _>>();
    watch.drain();
    let _ = watch.audit.end(if control.is_ok() {
        "in order"
    } else {
        "the control loop ended early"
    });
    control.and(others.map(|_| ()))
}

fn load_model(config: &Config) -> Result<Option<Model>, RuntimeError> {
    let Some(path) = &config.control.model else {
        return Ok(None);
    };
    access::check(path)?;
    let model = Model::load(path)?;
    model.check_robot(&config.robot_id, config.motors())?;
    Ok(Some(model))
}

/// Version and commit of this software.
fn software() -> String {
    format!("i2ris {} ({COMMIT})", env!("CARGO_PKG_VERSION"))
}

/// What the slower threads know at the start.
fn chronicle(config: &Config, model: Option<&Arc<Model>>) -> SharedChronicle {
    let shared = SharedChronicle::default();
    if let Some(model) = model {
        let file = config.control.model.clone().unwrap_or_default();
        let mut chronicle = shared.lock();
        chronicle.slots.active = Some(model.id());
        chronicle.known.insert(
            model.id(),
            Known {
                model: Arc::clone(model),
                file,
            },
        );
    }
    shared
}

/// All drives, ready to be enabled.
struct Drives {
    runners: Vec<PortRunner>,
    links: Vec<AxisLink>,
    found: Vec<AxisIdentity>,
}

/// All ports are opened before the first is configured, so that a missing one is found before any
/// drive is touched.
fn bring_up_ports(config: &Config) -> Result<Drives, RuntimeError> {
    let opened = config
        .ports
        .iter()
        .map(Port::<Opened>::open)
        .collect::<Result<Vec<_>, _>>()?;
    let (mut runners, mut links, mut found) = (Vec::new(), Vec::new(), Vec::new());
    for port in opened {
        let port = port.bring_up()?;
        found.extend_from_slice(port.axes());
        let (runner, of_port) = port.split();
        runners.push(runner);
        links.extend(of_port);
    }
    Ok(Drives {
        runners,
        links,
        found,
    })
}

/// Waits until the port threads read positions. The ones from bringing up may be old by now, and
/// the loop would take them for a line that went dead. One that really is dead is left to the loop,
/// which names it.
fn wait_for_positions(links: &mut [AxisLink]) {
    let start = clock::now();
    let fresh = |link: &mut AxisLink| link.feedback.read().stamp >= start;
    while !links.iter_mut().all(fresh) && clock::now() - start < FIRST_POSITIONS {
        clock::sleep(Nanos::from_millis(1));
    }
}

fn tell_granted(log: &mut dyn Write, granted: &Granted) {
    let scheduling = if granted.priority > 0 {
        "SCHED_FIFO"
    } else {
        "normal scheduling"
    };
    let memory = if granted.memory_locked {
        "locked"
    } else {
        "not locked"
    };
    say(
        log,
        format_args!(
            "loop: {scheduling} {}, memory {memory}, processor {:?}",
            granted.priority, granted.cpu
        ),
    );
    granted
        .warnings
        .iter()
        .for_each(|warning| say(log, format_args!("warning: {warning}")));
}

fn say(log: &mut dyn Write, line: std::fmt::Arguments<'_>) {
    // A closed or full log must not stop the robot.
    let _ = writeln!(log, "[{:12.6}] {line}", clock::now().as_seconds());
}

/// A running thread with the name that its failure is reported by.
struct Thread {
    name: &'static str,
    handle: JoinHandle<()>,
}

impl Thread {
    fn spawn(
        name: &'static str,
        work: impl FnOnce() + Send + 'static,
    ) -> Result<Self, RuntimeError> {
        let handle = thread::Builder::new()
            .name(name.to_owned())
            .spawn(work)
            .map_err(|source| RuntimeError::Thread { name, source })?;
        Ok(Self { name, handle })
    }

    fn join(self) -> Result<(), RuntimeError> {
        self.handle
            .join()
            .map_err(|_| RuntimeError::Died(self.name))
    }

    /// Starts the thread of shared memory and waits until clients can find it; the pulse is for the
    /// loop.
    fn relay(
        config: &Config,
        guard: DomainGuard,
        ends: RelayEnds,
        chronicle: SharedChronicle,
        desk: Desk,
        granted: mpsc::Receiver<(Granted, Nanos)>,
        quit: &Arc<AtomicBool>,
    ) -> Result<(Self, Pulse), RuntimeError> {
        let identity = Identity {
            motors: config.motors() as u32,
        };
        let (period, quit) = (config.control.period(), Arc::clone(quit));
        let pinned = config.control.cpu;
        let (up_in, up) = mpsc::channel();
        let thread = Self::spawn("ipc", move || {
            rt::keep_normal(pinned);
            match Server::create(guard).and_then(|server| Ok((server.pulse()?, server))) {
                Ok((pulse, server)) => {
                    let _ = up_in.send(Ok(pulse));
                    let relay = |granted| {
                        Relay::new(server, ends, identity, chronicle, desk, granted, period)
                    };
                    relay_until(&quit, relay, &granted, period);
                }
                Err(error) => {
                    let _ = up_in.send(Err(error));
                }
            }
        })?;
        match up.recv() {
            Ok(Ok(pulse)) => Ok((thread, pulse)),
            Ok(Err(error)) => Err(error.into()),
            Err(_) => Err(RuntimeError::Died("ipc")),
        }
    }

    fn keeper(
        config: &Config,
        keeper: Keeper,
        questions: mpsc::Receiver<Question>,
        answers: mpsc::Sender<Answer>,
        quit: &Arc<AtomicBool>,
    ) -> Result<Self, RuntimeError> {
        let (cpu, quit) = (config.control.cpu, Arc::clone(quit));
        Self::spawn("models", move || {
            rt::keep_normal(cpu);
            keeper.run(&quit, &questions, &answers);
        })
    }

    fn recorder(
        config: &Config,
        recorder: Recorder,
        wishes: mpsc::Receiver<Wish>,
        written: mpsc::Sender<Written>,
        lines: mpsc::Sender<String>,
        quit: &Arc<AtomicBool>,
    ) -> Result<Self, RuntimeError> {
        let (cpu, quit) = (config.control.cpu, Arc::clone(quit));
        Self::spawn("black box", move || {
            rt::keep_normal(cpu);
            recorder.run(&quit, &wishes, &written, |line| {
                // The log may be gone already.
                let _ = lines.send(line);
            });
        })
    }

    fn port(
        config: &Config,
        runner: PortRunner,
        events: mpsc::Sender<PortEvent>,
        quit: &Arc<AtomicBool>,
    ) -> Result<Self, RuntimeError> {
        let (control, quit) = (config.control.clone(), Arc::clone(quit));
        Self::spawn("port", move || {
            let priority = control.priority.saturating_sub(PORT_PRIORITY_DISTANCE);
            // What was refused here was refused to the loop as well, which says so.
            let _ = rt::request(Wanted {
                priority,
                cpu: None,
                lock_memory: false,
            });
            // The log may be gone already when the last events come.
            runner.run(&quit, |event| {
                let _ = events.send(event);
            });
        })
    }

    fn control(
        config: &ControlConfig,
        cycle: Cycle,
        ends: LoopEnds,
        links: Vec<AxisLink>,
        first: Nanos,
        granted: mpsc::Sender<Granted>,
        shutdown: &Arc<AtomicBool>,
    ) -> Result<Self, RuntimeError> {
        let (config, shutdown) = (config.clone(), Arc::clone(shutdown));
        Self::spawn("control", move || {
            let wanted = Wanted {
                priority: config.priority,
                cpu: config.cpu,
                lock_memory: config.lock_memory,
            };
            let _ = granted.send(rt::request(wanted));
            drop(granted);
            control_loop(&config, first, cycle, ends, links, &shutdown);
        })
    }
}

fn relay_until(
    quit: &AtomicBool,
    relay: impl FnOnce(Granted) -> Relay,
    granted: &mpsc::Receiver<(Granted, Nanos)>,
    period: Nanos,
) {
    // No answer means that the loop never started; the main thread ends everything then.
    let Ok((granted, first)) = granted.recv() else {
        return;
    };
    let mut relay = relay(granted);
    let mut ticker = Ticker::new(first - RELAY_LEAD, period, Nanos::ZERO);
    while !quit.load(Ordering::Acquire) {
        let tick = ticker.wait();
        relay.pass(tick.started);
    }
    relay.pass(clock::now());
}

/// The loop. From here on no allocation, no lock, no I/O: only [`Cycle::step`] and wait-free lanes.
fn control_loop(
    config: &ControlConfig,
    first: Nanos,
    mut cycle: Cycle,
    mut ends: LoopEnds,
    mut links: Vec<AxisLink>,
    shutdown: &AtomicBool,
) {
    let mut ticker = Ticker::new(
        first,
        config.period(),
        Nanos::from_micros(u64::from(config.spin_us)),
    );
    let mut log = TickLog::new(config.rate_hz);
    log.remember(&cycle, &mut ends.recorder);
    loop {
        let tick = ticker.wait();
        let mut offered = None;
        if !ends.offers.is_empty()
            && cycle.takes_candidates()
            && let Ok(offer) = ends.offers.pop()
        {
            offered = Some(offer.number);
            cycle.offer(offer.candidate);
        }
        let inputs = Inputs {
            servo: if ends.servo.update() {
                *ends.servo.output_buffer()
            } else {
                None
            },
            request: ends.requests.pop().ok(),
            model: ends.model_requests.pop().ok(),
            external: if ends.external.update() {
                *ends.external.output_buffer()
            } else {
                None
            },
            missed: u32::try_from(tick.missed).unwrap_or(u32::MAX),
            feedback: read_feedback(&mut links),
            shutdown: shutdown.load(Ordering::Acquire),
        };
        let outputs = cycle.step(tick.started, &inputs);
        for link in &mut links {
            if let Some(request) = outputs.requests.get(link.motor) {
                link.requests.write(*request);
            }
        }
        // Full lanes mean that a slower thread stalls. Its answers and lines are lost; the loop
        // goes on.
        let _ = outputs.reply.map(|reply| ends.replies.push(reply));
        let _ = outputs
            .model_reply
            .map(|reply| ends.model_replies.push(reply));
        // Nothing is freed here: what does not fit stays in the cycle.
        if !ends.retired.is_full()
            && let Some(retired) = cycle.retired()
        {
            let _ = ends.retired.push(retired);
        }
        for event in outputs.events.into_iter().flatten() {
            let _ = ends.events.push(event);
        }
        if let Some(pulse) = &ends.pulse {
            pulse.beat(
                tick.started,
                outputs.report.state == OperatingState::Disabled && !outputs.report.busy,
            );
        }
        let timing = TickTiming {
            tick,
            ended: clock::now(),
        };
        let _ = ends.records.push(Record {
            report: outputs.report,
            timing,
        });
        log.push(
            TickRecord {
                number: 0,
                offered,
                inputs,
                outputs,
                timing,
            },
            &mut ends.recorder,
        );
        log.remember(&cycle, &mut ends.recorder);
        if outputs.finished {
            return;
        }
    }
}

/// What the loop hands to the black box.
struct TickLog {
    ticks: u64,
    interval: u64,
    /// The next snapshot is due from this tick on.
    due: u64,
}

impl TickLog {
    /// A snapshot every second.
    fn new(rate_hz: u32) -> Self {
        Self {
            ticks: 0,
            interval: u64::from(rate_hz),
            due: 0,
        }
    }

    fn push(&mut self, tick: TickRecord, ends: &mut RecorderEnds) {
        self.ticks += 1;
        // A full lane means that the recorder stalls: it sees the gap in the numbers.
        let _ = ends.ticks.push(TickRecord {
            number: self.ticks,
            ..tick
        });
    }

    fn remember(&mut self, cycle: &Cycle, ends: &mut RecorderEnds) {
        if self.ticks >= self.due
            && !ends.snapshots.is_full()
            && let Some(snapshot) = cycle.snapshot()
            && ends.snapshots.push(snapshot).is_ok()
        {
            self.due = self.ticks + self.interval;
        }
    }
}

fn read_feedback(links: &mut [AxisLink]) -> [AxisFeedback; MAX_MOTORS] {
    let mut feedback = [AxisFeedback::default(); MAX_MOTORS];
    for link in links {
        if let Some(slot) = feedback.get_mut(link.motor) {
            *slot = *link.feedback.read();
        }
    }
    feedback
}

/// The main thread while the others run.
struct Watch<'a> {
    events: Consumer<Event>,
    port_events: mpsc::Receiver<PortEvent>,
    lines: mpsc::Receiver<String>,
    audit: Audit,
    domain: Domain,
    boot_id: u64,
    log: &'a mut dyn Write,
}

impl Watch<'_> {
    /// Writes the log until the loop has ended. A helper thread that ends early makes the loop shut
    /// down.
    fn until_end(
        &mut self,
        control: &Thread,
        helpers: &[&Thread],
        ports: &[Thread],
        shutdown: &AtomicBool,
    ) {
        while !control.handle.is_finished() {
            if ports
                .iter()
                .chain(helpers.iter().copied())
                .any(|thread| thread.handle.is_finished())
            {
                shutdown.store(true, Ordering::Release);
            }
            self.drain();
            clock::sleep(LOG_PERIOD);
        }
    }

    /// Who has taken the lease.
    fn caller(&self, event: &Event) -> Option<String> {
        match event.kind {
            EventKind::Lease { client_id } if client_id != 0 => {
                look_up(&self.domain, self.boot_id, client_id).map(|caller| caller.to_string())
            }
            _ => None,
        }
    }

    fn drain(&mut self) {
        while let Ok(event) = self.port_events.try_recv() {
            // The loop tells about phases, too, at the tick that acts on them.
            if !matches!(event.kind, PortEventKind::Phase { .. }) {
                say(self.log, format_args!("{event}"));
            }
        }
        while let Ok(event) = self.events.pop() {
            let caller = self.caller(&event);
            match &caller {
                Some(caller) => drop(writeln!(self.log, "{event}: {caller}")),
                None => drop(writeln!(self.log, "{event}")),
            }
            // A disk that is full does not stop the robot.
            let _ = self.audit.note(&event, caller.as_deref());
        }
        while let Ok(line) = self.lines.try_recv() {
            say(self.log, format_args!("{line}"));
        }
        let _ = self.log.flush();
    }
}
