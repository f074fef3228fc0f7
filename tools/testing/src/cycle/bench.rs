//! A cycle with two simulated drives, on simulated time, checked against the invariants.

use std::sync::Arc;

use i2ris::config::Config;
use i2ris::core::cycle::ControlCycle;
use i2ris::core::{
    CycleEventKind, CycleInputs, CycleOutputs, CycleReport, ExternalPose, FixtureChange,
    HistoryCursor, JointReport, ModelCandidate, ModelChange, ModelSwapRequest, ServoCommand,
    ServoGoal, StateReply, StateRequest, Validity,
};
use i2ris::drive::{AxisPhase, Demand};
use i2ris::ipc::{OperatingState, Refusal, StateCommand};
use i2ris::model::{History, Model};
use i2ris::process::black_box::BlackBox;
use i2ris::robot::Reason;
use i2ris::units::{Counts, Nanos, OutputVec};

use super::SimulatedDrive;
use super::invariants::{InvariantCheck, Recording};
use super::sample_models::{camera_frame, config, rad, standard_model};

pub struct Bench {
    pub cycle: ControlCycle,
    pub config: Config,
    pub now: Nanos,
    pub drives: [SimulatedDrive; 2],
    /// Counts only where the configuration has an auxiliary axis.
    pub jaw: SimulatedDrive,
    pub jaw_command: Option<ServoCommand>,
    pub out: CycleOutputs,
    pub events: Vec<CycleEventKind>,
    pub reasons: Vec<Reason>,
    pub shutdown: bool,
    pub model_request: Option<ModelSwapRequest>,
    /// The clutch is open in servo commands from now on.
    pub clutched: bool,
    pub pose: Option<(OutputVec, u32)>,
    pub fixture: Option<FixtureChange>,
    /// How old requests are that are valid for a second.
    pub request_age: Nanos,
    pub external: Option<ExternalPose>,
    /// A camera that sees the estimate and this shift, rad, 30 times a second and 20 ms late.
    pub camera: Option<[f64; 2]>,
    pub ignored_frames: u64,
    /// How many ticks late every tick is from now on.
    pub missed: u32,
    /// Something that counts, read before and after every step, and the sum of the differences.
    pub probe: fn() -> u64,
    pub probed: u64,
    /// Motor path and its cursor, as kept by the thread that stages models.
    pub history: History,
    pub mark: HistoryCursor,
    pub recording: Option<Recording>,
    client_sequence: u64,
    request_id: u64,
    watch: InvariantCheck,
}

/// The client that the helpers of [`Bench`] speak for.
pub const CLIENT: u64 = 7;

impl Bench {
    pub fn new(config: Config, model: Option<Arc<Model>>) -> Self {
        let mut bench = Self {
            cycle: ControlCycle::new(&config, model),
            watch: InvariantCheck::new(&config),
            config,
            now: Nanos::from_millis(10_000),
            drives: [SimulatedDrive::new(0), SimulatedDrive::new(0)],
            jaw: SimulatedDrive::new(0),
            jaw_command: None,
            out: ControlCycle::new(&super::config(""), None)
                .step(Nanos::ZERO, &CycleInputs::default()),
            events: Vec::with_capacity(1000),
            reasons: Vec::with_capacity(1000),
            shutdown: false,
            model_request: None,
            clutched: false,
            pose: None,
            fixture: None,
            request_age: Nanos::ZERO,
            external: None,
            camera: None,
            ignored_frames: 0,
            missed: 0,
            probe: || 0,
            probed: 0,
            history: History::default(),
            mark: HistoryCursor::default(),
            recording: None,
            client_sequence: 0,
            request_id: 0,
        };
        for drive in &mut bench.drives {
            drive.feedback.stamp = bench.now;
        }
        bench.jaw.feedback.stamp = bench.now;
        bench.step(None, None);
        bench
    }

    pub fn standard() -> Self {
        Self::new(config(""), Some(standard_model()))
    }

    pub fn step(&mut self, servo: Option<ServoCommand>, request: Option<StateRequest>) {
        let requests = self.out.requests;
        self.now = self.now + self.config.control.period();
        for (drive, request) in self.drives.iter_mut().zip(&requests) {
            drive.tick(self.now, request);
        }
        if let Some(request) = &self.out.auxiliary {
            self.jaw.tick(self.now, request);
        }
        let feedback = [self.drives[0].feedback, self.drives[1].feedback];
        self.see();
        let inputs = CycleInputs {
            servo,
            jaw: self.jaw_command.take(),
            request,
            model: self.model_request.take(),
            external: self.external.take(),
            ignored_frames: self.ignored_frames,
            missed: self.missed,
            feedback,
            auxiliary: self.jaw.feedback,
            shutdown: self.shutdown,
        };
        let before = (self.probe)();
        self.out = self.cycle.step(self.now, &inputs);
        let retired = self.cycle.take_retired();
        // Once per second, as the controller, if nothing records.
        let is_second = self.out.requests[0].sequence.is_multiple_of(1000);
        let keeps = |it: &Recording| (it.keeps)(it.ticks.len() + 1);
        let is_due = self.recording.as_ref().map_or(is_second, keeps);
        let snapshot = is_due.then(|| self.cycle.snapshot()).flatten();
        self.probed += (self.probe)() - before;
        drop(retired);
        if let Some(recording) = &mut self.recording {
            recording.push(self.now, &inputs, &self.out, snapshot);
        }
        self.watch.check(&inputs, &self.out);
        self.note_events();
        self.record_motion();
    }

    fn see(&mut self) {
        if let Some([pitch, yaw]) = self.camera
            && (self.now.0 / 1_000_000).is_multiple_of(33)
            && let Some(joint) = self.out.report.joint
        {
            self.external = Some(camera_frame(
                self.now - Nanos::from_millis(20),
                [joint.measured[0] + pitch, joint.measured[1] + yaw, 0.0],
            ));
        }
    }

    fn record_motion(&mut self) {
        let mark = self.out.report.mark;
        if mark.epoch != self.mark.epoch {
            self.history.forget();
        }
        if mark != self.mark {
            let position = self.out.report.feedback.map(|drive| drive.position.as_f64());
            let time_s = self.config.control.period().as_seconds();
            self.history.push_after(&position, time_s);
            self.mark = mark;
        }
    }

    pub fn candidate(&self, model: &Arc<Model>) -> ModelCandidate {
        ModelCandidate::new(Arc::clone(model), &self.config, &self.history, self.mark)
    }

    pub fn black_box(&mut self, first: &Model) -> BlackBox {
        self.recording.take().unwrap().black_box(first, &self.config)
    }

    pub fn offer(&mut self, candidate: ModelCandidate) {
        if let Some(recording) = &mut self.recording {
            recording.offer(&candidate);
        }
        let before = (self.probe)();
        assert!(self.cycle.can_stage_model());
        self.cycle.stage_model(candidate);
        self.probed += (self.probe)() - before;
    }

    pub fn change_model(&mut self, change: ModelChange, forced: bool) -> Refusal {
        self.change_model_as(CLIENT, change, forced)
    }

    pub fn change_model_as(
        &mut self,
        client_id: u64,
        change: ModelChange,
        forced: bool,
    ) -> Refusal {
        self.request_id += 1;
        let (id, validity) = (self.request_id, self.validity());
        let request = ModelSwapRequest { id, client_id, validity, change, forced };
        self.model_request = Some(request);
        self.tick();
        let reply = self.out.model_reply.expect("a change of the model is answered in its tick");
        assert_eq!(reply.id, self.request_id);
        reply.refusal
    }

    pub fn stage(&mut self, model: &Arc<Model>) {
        self.offer(self.candidate(model));
        self.tick();
    }

    /// Stages a model, waits until it has caught up, and lets it take over.
    pub fn swap(&mut self, model: &Arc<Model>) -> Refusal {
        self.stage(model);
        self.change_model(ModelChange::Activate(model.id()), false)
    }

    fn note_events(&mut self) {
        for event in self.out.events.iter().flatten() {
            assert_eq!(event.stamp, self.now);
            if self.events.len() < self.events.capacity() {
                self.events.push(event.kind);
                self.reasons.extend(event.reason());
            }
        }
    }

    pub fn tick(&mut self) {
        self.step(None, None);
    }

    pub fn run(&mut self, ticks: usize) {
        for _ in 0..ticks {
            self.tick();
        }
    }

    /// Time passes without ticks.
    pub fn skip(&mut self, span: Nanos) {
        self.now = self.now + span;
    }

    fn validity(&self) -> Validity {
        let (stamp, span) = (self.now - self.request_age, Nanos::from_millis(1000));
        Validity { stamp, span }
    }

    pub fn ask_as(&mut self, client_id: u64, command: StateCommand) -> StateReply {
        let pose = self.pose.take().map(|(pose, entries)| ServoGoal::Joint(pose, entries));
        self.ask_for(client_id, command, pose)
    }

    /// One tick with a state command that has a pose of any kind.
    pub fn ask_for(
        &mut self,
        client_id: u64,
        command: StateCommand,
        pose: Option<ServoGoal>,
    ) -> StateReply {
        self.request_id += 1;
        let id = self.request_id;
        let fixture = self.fixture.take();
        let validity = self.validity();
        let request = StateRequest { id, client_id, validity, command, pose, fixture };
        self.step(None, Some(request));
        let reply = self.out.reply.expect("a state command is answered in its tick");
        assert_eq!(reply.id, id);
        assert_eq!(reply.state, self.out.report.state);
        reply
    }

    pub fn ask(&mut self, command: StateCommand) -> Refusal {
        self.ask_as(CLIENT, command).refusal
    }

    /// A state command that is accepted, until it has been carried out.
    pub fn carry_out(&mut self, command: StateCommand) {
        assert_eq!(self.ask(command), Refusal::None);
        self.idle();
    }

    pub fn go(&mut self, pitch_deg: f64, yaw_deg: f64) -> Refusal {
        self.pose = Some((rad(pitch_deg, yaw_deg), 2));
        self.ask(StateCommand::Move)
    }

    pub fn change_fixtures(&mut self, client_id: u64, change: FixtureChange) -> Refusal {
        self.fixture = Some(change);
        self.ask_as(client_id, StateCommand::Fixture).refusal
    }

    /// A servo command of the usual client, sent now.
    pub fn servo(&mut self, goal: ServoGoal) -> ServoCommand {
        self.client_sequence += 1;
        let stamp = self.now + self.config.control.period();
        ServoCommand {
            client_id: CLIENT,
            sequence: self.client_sequence,
            stamp,
            deadline: Nanos::ZERO,
            goal,
            clutched: self.clutched,
            has_unknown_flags: false,
        }
    }

    /// One tick with a servo command; the refusal, or `None` if it was accepted.
    pub fn send(&mut self, command: ServoCommand) -> Refusal {
        self.answer(|bench| bench.step(Some(command), None))
    }

    /// The same for the auxiliary axis.
    pub fn send_jaw(&mut self, command: ServoCommand) -> Refusal {
        self.jaw_command = Some(command);
        self.answer(Self::tick)
    }

    fn answer(&mut self, tick: impl FnOnce(&mut Self)) -> Refusal {
        let (accepted, refused) = (self.report().accepted, self.report().refused);
        tick(self);
        match (self.report().accepted - accepted, self.report().refused - refused) {
            (1, 0) => Refusal::None,
            (0, 1) => self.report().last_refusal,
            other => panic!("one command is accepted or refused, not {other:?}"),
        }
    }

    pub fn goal(&mut self, goal: ServoGoal) -> Refusal {
        let command = self.servo(goal);
        self.send(command)
    }

    pub fn joint(&mut self, pitch_deg: f64, yaw_deg: f64) -> Refusal {
        self.goal(ServoGoal::Joint(rad(pitch_deg, yaw_deg), 2))
    }

    pub fn actuator(&mut self, counts: [i32; 2]) -> Refusal {
        self.goal(ServoGoal::Actuator(counts.map(Counts), 2))
    }

    pub fn report(&self) -> &CycleReport {
        &self.out.report
    }

    pub fn joints(&self) -> JointReport {
        self.out.report.joint.expect("a model is loaded and drives have reported")
    }

    pub fn state(&self) -> OperatingState {
        self.out.report.state
    }

    pub fn targets(&self) -> [i32; 2] {
        [self.out.requests[0].target.0, self.out.requests[1].target.0]
    }

    pub fn demands(&self) -> [Demand; 2] {
        self.out.requests.map(|request| request.demand)
    }

    pub fn pose_deg(&self) -> [f64; 2] {
        let [pitch, yaw, _] = self.joints().setpoint.map(f64::to_degrees);
        [pitch, yaw]
    }

    pub fn phases(&self) -> [AxisPhase; 2] {
        [self.drives[0].feedback.phase, self.drives[1].feedback.phase]
    }

    /// Runs until something holds, at most 40 seconds: longer than any timeout.
    pub fn until(&mut self, what: &str, holds: impl Fn(&Self) -> bool) {
        for _ in 0..40_000_000_000 / self.config.control.period().0 {
            if holds(self) {
                return;
            }
            self.tick();
        }
        panic!("waited in vain for: {what}; {:?}", self.out.report);
    }

    pub fn idle(&mut self) {
        self.until("not busy", |bench| !bench.report().busy);
    }
}
