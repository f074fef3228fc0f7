//! The system: its parts, what may happen to them, and the facts that the properties need.

use std::collections::{HashSet, VecDeque};

use i2ris::ipc::heartbeat::{ControllerAbsent, Heartbeat};
use i2ris::robot::DrivePower;
use i2ris::watchdog::{ControllerStatus, HeartbeatMonitor};

use super::*;

/// A servo command as its client knows it.
#[derive(Debug, Clone, Copy)]
struct Sent {
    client: usize,
    id: u64,
    sequence: u64,
    at: Nanos,
    goal: ServoGoal,
}

/// Facts that no part of the system knows, but the properties need.
#[derive(Debug, Default)]
struct Truth {
    /// The last accepted command, its time, and whether its client released the lease.
    followed: Option<(Sent, Nanos, bool)>,
    accepted: HashSet<(u64, u64)>,
    positions_at: Nanos,
    has_open_fault: bool,
    has_recovered: bool,
    is_enabled: bool,
    /// Ticks of the loop since each property last permitted motion.
    since: [u32; GUARDS.len()],
    /// Ticks without the loop while drives are powered and can be reached.
    silent: u32,
    was_unreachable: bool,
}

pub(super) struct System {
    bench: Bench,
    missing: Option<Guard>,
    random: Random,
    process: Process,
    monitor: HeartbeatMonitor,
    heartbeat: Option<Heartbeat>,
    boot_id: u64,
    /// The newest id and number that were given to anyone.
    last_id: u64,
    sequence: u64,
    clients: [u64; 2],
    network: VecDeque<Sent>,
    waiting: [Option<Sent>; 2],
    request: Option<(u64, StateCommand)>,
    line_up: bool,
    truth: Truth,
    pub failed: [bool; GUARDS.len()],
    pub reached: [bool; 6],
}

/// A controller that has just started, with deadlines as short as the runs are.
fn controller(missing: Option<Guard>) -> Bench {
    let deadline = if missing == Some(Guard::Deadline) { LEASE } else { DEADLINE };
    let ms = |span: Nanos| span.0 / 1_000_000;
    let tables = format!(
        "[command]\ndeadline_ms = {}\nlease_timeout_ms = {}\n[limits]\nfeedback_stale_ms = {}\n\
         acceleration_counts_s2 = 2e6\nstop_deceleration_counts_s2 = 2e6\n",
        ms(deadline),
        ms(LEASE),
        ms(FRESH)
    );
    Bench::new(config(&tables), None)
}

impl System {
    /// ENABLED, and still.
    pub fn new(seed: u64, missing: Option<Guard>) -> Self {
        let mut bench = controller(missing);
        bench.home();
        bench.enable();
        let silence = if missing == Some(Guard::Patience) { Nanos::ZERO } else { SILENCE };
        let mut system = Self {
            missing,
            random: Random::new(seed),
            process: Process::Runs,
            monitor: HeartbeatMonitor::new(silence),
            heartbeat: None,
            boot_id: 1,
            last_id: 102,
            sequence: 0,
            clients: [101, 102],
            network: VecDeque::new(),
            waiting: [None; 2],
            request: None,
            line_up: true,
            truth: Truth { is_enabled: true, positions_at: bench.now, ..Truth::default() },
            failed: [false; GUARDS.len()],
            reached: [false; 6],
            bench,
        };
        system.begin();
        system
    }

    /// The watchdog sees the loop long before a client can.
    fn begin(&mut self) {
        let (boot_id, stamp) = (self.boot_id, self.bench.now);
        self.heartbeat = Some(Heartbeat { boot_id, stamp, ..Heartbeat::default() });
        self.watch(stamp);
    }

    fn lacks(&self, guard: Guard) -> bool {
        self.missing == Some(guard)
    }

    fn new_id(&mut self) -> u64 {
        self.last_id += 1;
        self.last_id
    }

    fn is_powered(&self) -> bool {
        self.bench.phases().iter().any(|it| matches!(it, AxisPhase::Enabling | AxisPhase::Enabled))
    }

    fn is_on(&self) -> bool {
        self.bench.phases() == [AxisPhase::Enabled; 2]
    }

    /// Drives that are not to be enabled have no target.
    fn has_targets(&self) -> bool {
        self.is_on() && self.bench.demands() == [Demand::Enabled; 2]
    }

    pub fn act(&mut self, action: Action) {
        let runs = self.process == Process::Runs;
        match action {
            Action::Nothing => {}
            Action::Send(client) => self.send(client),
            Action::Deliver { copy } => {
                let packet = self.network.pop_front();
                self.waiting[1] = packet.or(self.waiting[1]);
                self.network.extend(packet.filter(|_| copy));
            }
            Action::Relaunch(client) => self.clients[client] = self.new_id(),
            Action::Ask(command) if runs => {
                // By a client, which begins a session, or by an operator.
                let asking = [self.clients[0], self.clients[1], self.new_id()];
                self.request = Some((asking[self.random.below(3) as usize], command));
            }
            Action::Release(client) if runs => {
                self.request = Some((self.clients[client], StateCommand::Release));
            }
            Action::DriveFault if self.is_on() => {
                let drive = &mut self.bench.drives[self.random.below(2) as usize];
                (drive.feedback.phase, drive.feedback.error_code) = (AxisPhase::Faulted, 0x8611);
            }
            Action::Line(up) => {
                self.line_up = up;
                let quirk = if up { Quirk::None } else { Quirk::Silent };
                self.bench.drives.iter_mut().for_each(|drive| drive.quirk = quirk);
            }
            Action::Kill if !matches!(self.process, Process::Dead(_)) => {
                self.process = Process::Dead(0);
                (self.waiting, self.request) = ([None; 2], None);
            }
            Action::Hang if runs => self.process = Process::Hangs,
            Action::Continue if self.process == Process::Hangs => self.process = Process::Runs,
            Action::Restart => self.restart(),
            _ => {}
        }
    }

    fn send(&mut self, client: usize) {
        self.sequence += 1;
        // Towards the middle, so that the snake is always on its way.
        let near = self.bench.targets().map(|at| Counts(at + if at > 0 { -60 } else { 60 }));
        let (id, at) = (self.clients[client], self.bench.now);
        let goal = ServoGoal::Actuator(near, 2);
        let sent = Sent { client, id, sequence: self.sequence, at, goal };
        if client == 0 {
            self.waiting[0] = Some(sent);
        } else {
            self.network.push_back(sent);
            self.network.truncate(2);
        }
    }

    /// Succeeds only when every drive answers and is off.
    fn restart(&mut self) {
        if !self.line_up || !matches!(self.process, Process::Dead(START..)) {
            return;
        }
        let mut started = controller(self.missing);
        (started.now, started.drives) = (self.bench.now, self.bench.drives);
        for drive in &mut started.drives {
            // The thread of the port also starts again.
            (drive.feedback.homings, drive.feedback.fault_resets) = (0, 0);
            drive.feedback.written = None;
            if drive.feedback.phase != AxisPhase::Faulted {
                drive.feedback.phase = AxisPhase::Disabled;
            }
        }
        (self.bench, self.process) = (started, Process::Runs);
        self.boot_id += 1;
        self.begin();
        self.truth.accepted.clear();
        (self.truth.followed, self.truth.is_enabled) = (None, false);
        self.truth.has_open_fault = false;
        if self.lacks(Guard::Restart) {
            let _ = self.bench.ask_as(self.last_id, StateCommand::Enable);
        }
    }

    /// The watchdog looks, and the loop runs if it does.
    pub fn step(&mut self) {
        let (targets, had_targets) = (self.bench.targets(), self.has_targets());
        self.watch(self.bench.now + TICK);
        match &mut self.process {
            Process::Runs => {
                self.tick();
                let moves = self.bench.targets() != targets;
                self.check(had_targets && self.has_targets() && moves);
            }
            Process::Hangs => self.bench.skip(TICK),
            Process::Dead(ticks) => {
                *ticks += 1;
                self.bench.skip(TICK);
            }
        }
        let is_silent = self.process != Process::Runs && self.is_powered();
        self.truth.was_unreachable &= is_silent;
        let counts = is_silent && !self.truth.was_unreachable;
        self.truth.silent = if counts { self.truth.silent + 1 } else { 0 };
        self.failed[Guard::Watchdog as usize] |= self.truth.silent > NOTICE;
    }

    fn watch(&mut self, now: Nanos) {
        if self.lacks(Guard::Watchdog) {
            return;
        }
        let read = match self.process {
            Process::Dead(_) => Err(ControllerAbsent { last: self.heartbeat }),
            _ => Ok(self.heartbeat),
        };
        let status = self.monitor.update(read, now);
        if !matches!(status, ControllerStatus::Died | ControllerStatus::Hangs) {
            return;
        }
        let is_young = self.heartbeat.is_some_and(|it| now.duration_since(it.stamp) <= TICK);
        self.failed[Guard::Patience as usize] |= self.process == Process::Runs && is_young;
        if !self.line_up {
            self.truth.was_unreachable = true;
        } else if self.is_powered() {
            self.reached[Reached::WatchdogStops as usize] = true;
            for drive in &mut self.bench.drives {
                if matches!(drive.feedback.phase, AxisPhase::Enabling | AxisPhase::Enabled) {
                    drive.feedback.phase = AxisPhase::QuickStopped;
                }
            }
        }
    }

    fn tick(&mut self) {
        let now = self.bench.now + TICK;
        if self.line_up {
            self.truth.positions_at = now;
        } else if self.lacks(Guard::Freshness) {
            for drive in &mut self.bench.drives {
                drive.feedback.stamp = now;
                drive.feedback.sequence += 1;
            }
        }
        let state = self.bench.state();
        let first = self.random.below(2) as usize;
        if let Some((id, command)) = self.request.take() {
            self.ask(id, command);
        } else if let Some(sent) =
            self.waiting[first].take().or_else(|| self.waiting[1 - first].take())
        {
            self.command(sent);
        } else {
            self.bench.tick();
        }
        let report = self.bench.report();
        // As the control loop reports it.
        let oldest = now - FRESH - FRESH - FRESH;
        let may_be_off = match report.state {
            OperatingState::Disabled => !report.busy,
            OperatingState::Fault => true,
            OperatingState::Enabled | OperatingState::Paused => false,
        };
        let mut drives = self.bench.drives.iter();
        let off = may_be_off && drives.all(|it| it.feedback.power(oldest) == DrivePower::Off);
        let (boot_id, stamp) = (self.boot_id, self.bench.now);
        self.heartbeat = Some(Heartbeat { boot_id, stamp, off, ..Heartbeat::default() });
        if report.state == OperatingState::Fault && state != OperatingState::Fault {
            (self.truth.has_open_fault, self.truth.is_enabled) = (true, false);
            if self.lacks(Guard::Acknowledge) {
                self.request = Some((self.last_id, StateCommand::Acknowledge));
            }
        }
    }

    fn ask(&mut self, id: u64, command: StateCommand) {
        let is_hidden = command == StateCommand::Disable && self.lacks(Guard::Enabled)
            || command == StateCommand::Release && self.lacks(Guard::Release);
        if is_hidden {
            self.bench.tick();
        } else if self.bench.ask_as(id, command).refusal != Refusal::None {
            return;
        }
        let truth = &mut self.truth;
        match command {
            StateCommand::Enable => truth.is_enabled = true,
            StateCommand::Disable => truth.is_enabled = false,
            StateCommand::Acknowledge if self.missing != Some(Guard::Acknowledge) => {
                (truth.has_open_fault, truth.has_recovered) = (false, true);
            }
            StateCommand::Release => {
                if let Some((sent, _, released)) = &mut truth.followed {
                    *released |= sent.id == id;
                }
            }
            _ => {}
        }
    }

    /// The loop takes a command.
    fn command(&mut self, sent: Sent) {
        let now = self.bench.now + TICK;
        if self.lacks(Guard::Sequence) {
            self.sequence += 1;
        }
        let refusal = self.bench.send(ServoCommand {
            client_id: if self.lacks(Guard::Lease) { 101 } else { sent.id },
            sequence: if self.lacks(Guard::Sequence) { self.sequence } else { sent.sequence },
            stamp: if self.lacks(Guard::Age) { now } else { sent.at },
            deadline: Nanos::ZERO,
            goal: sent.goal,
            clutched: false,
            has_unknown_flags: false,
        });
        if refusal != Refusal::None {
            return;
        }
        if let Some((before, at, released)) = self.truth.followed.filter(|it| it.0.id != sent.id) {
            let leads = now.duration_since(at) < LEASE && !released;
            self.failed[Guard::Lease as usize] |= leads;
            self.reached[Reached::LeaseChanges as usize] |= before.client != sent.client;
        }
        let is_new = self.truth.accepted.insert((sent.id, sent.sequence));
        self.failed[Guard::Sequence as usize] |= !is_new;
        self.truth.followed = Some((sent, now, false));
    }

    /// Whether the snake may have moved in this tick.
    fn check(&mut self, moved: bool) {
        let (now, truth) = (self.bench.now, &mut self.truth);
        let young = |at: Nanos, most: Nanos| now.duration_since(at) <= most;
        let permits = [
            (Guard::Deadline, truth.followed.is_some_and(|(_, at, _)| young(at, DEADLINE))),
            (Guard::Age, truth.followed.is_some_and(|(sent, ..)| young(sent.at, DEADLINE))),
            (Guard::Release, truth.followed.is_some_and(|(.., released)| !released)),
            (Guard::Freshness, young(truth.positions_at, FRESH)),
            (Guard::Acknowledge, !truth.has_open_fault),
            (Guard::Restart, self.boot_id == 1 || truth.is_enabled),
            (Guard::Enabled, truth.is_enabled),
        ];
        for (guard, is_permitted) in permits {
            let since = &mut truth.since[guard as usize];
            *since = if is_permitted { 0 } else { *since + 1 };
            self.failed[guard as usize] |= moved && *since > STOP;
        }
        if let Some((sent, at, _)) = truth.followed.filter(|_| moved) {
            let moves = [Reached::NearMoves, Reached::FarMoves][sent.client];
            self.reached[moves as usize] = true;
            self.reached[Reached::LateCommandMoves as usize] |= !young(sent.at, TICK) && at == now;
            self.reached[Reached::MovesAfterFault as usize] |= truth.has_recovered;
        }
    }

    /// Up to three actions between two ticks; most are sent commands.
    pub fn run(mut self, ticks: u64) -> Self {
        for _ in 0..ticks {
            for _ in 0..self.random.below(4) {
                let kinds = DRAWN[self.random.below(DRAWN.len() as u64) as usize];
                let action = ACTIONS[self.random.below(kinds as u64) as usize];
                self.act(action);
            }
            self.step();
        }
        self
    }

    pub fn require_all(&self, what: &str) {
        for (guard, name) in GUARDS {
            assert!(!self.failed[guard as usize], "not {name}: {what}");
        }
    }
}
