//! Invariants that hold in every tick, for any inputs; and ticks recorded as the black box does.

use i2ris::config::Config;
use i2ris::core::ModelCandidate;
use i2ris::core::{CycleEvent, CycleEventKind, CycleInputs, CycleOutputs, CycleSnapshot};
use i2ris::drive::{AxisPhase, AxisRequest, Demand};
use i2ris::ipc::{Fault, OperatingState, Refusal};
use i2ris::model::Model;
use i2ris::process::black_box::{BlackBox, BlackBoxHeader, OfferRecord, TickRecord};
use i2ris::realtime::{Tick, TickTiming};
use i2ris::units::Nanos;

pub struct InvariantCheck {
    /// Counts per tick.
    velocity: f64,
    /// Counts per tick, per tick.
    slow_down: f64,
    /// Ticks of a stop from full speed, with those that the jerk limit adds.
    stop_ticks: u32,
    /// Lowest and highest position of every motor, counts.
    limits: Vec<(i32, i32)>,
    axes: [AxisWatch; 2],
    state: OperatingState,
    last: Option<CycleOutputs>,
}

#[derive(Clone, Copy, Default)]
struct AxisWatch {
    /// Targets of the last two ticks in which the drive followed.
    target: Option<i32>,
    before: Option<i32>,
    /// Ticks since ENABLED was left.
    quiet: u32,
}

impl InvariantCheck {
    pub fn new(config: &Config) -> Self {
        let tick = config.control.period().as_seconds();
        let axes = (0..config.motors()).filter_map(|motor| config.axis(motor));
        let limits =
            axes.map(|axis| (axis.position_min_counts.0, axis.position_max_counts.0)).collect();
        let velocity = config.limits.velocity_counts_s * tick;
        let slow_down = config.limits.stop_deceleration_counts_s2 * tick * tick;
        let window = config.limits.window_ticks(config.control.period()).unwrap_or(1);
        Self {
            velocity,
            slow_down,
            stop_ticks: (velocity / slow_down).ceil() as u32 + window - 1,
            limits,
            axes: [AxisWatch::default(); 2],
            state: OperatingState::Disabled,
            last: None,
        }
    }

    pub fn check(&mut self, inputs: &CycleInputs, outputs: &CycleOutputs) {
        self.check_states(outputs);
        self.check_counters(inputs, outputs);
        check_numbers(outputs);
        for motor in 0..self.limits.len() {
            self.check_axis(motor, inputs, outputs);
        }
        for absent in &outputs.requests[self.limits.len()..] {
            assert_eq!(**absent, AxisRequest::default());
        }
        self.last = Some(*outputs);
    }

    /// Every change of state is an event, and the chain of events has no gap.
    fn check_states(&mut self, outputs: &CycleOutputs) {
        let report = &outputs.report;
        for CycleEvent { kind, .. } in outputs.events.iter().flatten() {
            if let CycleEventKind::State { from, to, .. } = kind {
                assert_eq!(*from, self.state);
                self.state = *to;
            }
        }
        assert_eq!(self.state, report.state);
        assert!(report.state != OperatingState::Fault || report.fault != Fault::None);
        assert!(!outputs.finished || report.state != OperatingState::Enabled);
    }

    fn check_counters(&self, inputs: &CycleInputs, outputs: &CycleOutputs) {
        assert_eq!(outputs.reply.map(|reply| reply.id), inputs.request.map(|request| request.id));
        let Some(last) = &self.last else { return };
        let (before, after) = (&last.report, &outputs.report);
        let answered = (after.accepted - before.accepted) + (after.refused - before.refused);
        let commands = [&inputs.servo, &inputs.jaw].into_iter().flatten();
        assert_eq!(answered, commands.clone().count() as u64);
        if after.accepted > before.accepted {
            assert_eq!(after.state, OperatingState::Enabled);
            let mut clients = commands.map(|command| command.client_id);
            assert!(clients.any(|client_id| client_id == after.lease_client_id));
        }
        if after.state != before.state {
            assert_eq!(after.since, after.now);
        }
        for (before, after) in last.requests.iter().zip(&outputs.requests).take(self.limits.len()) {
            assert_eq!(after.sequence, before.sequence + 1);
            let homings = after.homings - before.homings;
            let fault_resets = after.fault_resets - before.fault_resets;
            assert!(homings <= 1 && fault_resets <= 1);
            let accepted = outputs.reply.is_some_and(|reply| reply.refusal == Refusal::None);
            let raised = homings != 0 || fault_resets != 0;
            assert!(accepted || !raised, "counters rise on accepted commands only");
        }
    }

    fn check_axis(&mut self, motor: usize, inputs: &CycleInputs, outputs: &CycleOutputs) {
        let (request, axis) = (&outputs.requests[motor], &mut self.axes[motor]);
        let (phase, demand) = (inputs.feedback[motor].phase, request.demand);
        assert_eq!(request.target, outputs.report.setpoints[motor]);
        use OperatingState as S;
        match outputs.report.state {
            S::Disabled if phase == AxisPhase::Homing => assert_ne!(demand, Demand::Enabled),
            _ if phase == AxisPhase::Homing => assert_eq!(demand, Demand::QuickStop),
            S::Disabled if !outputs.report.busy => assert_eq!(demand, Demand::Disabled),
            S::Disabled => assert_ne!(demand, Demand::QuickStop),
            S::Enabled | S::Paused => assert_eq!(demand, Demand::Enabled),
            S::Fault => assert_ne!(demand, Demand::Enabled),
        }
        let firm = demand == Demand::Enabled && phase == AxisPhase::Enabled;
        if !firm {
            let position = inputs.feedback[motor].position;
            assert_eq!(request.target, position, "a drive that does not follow has no setpoint");
            *axis = AxisWatch::default();
            return;
        }
        let (lowest, highest) = self.limits[motor];
        assert!((lowest..=highest).contains(&request.target.0), "{}", request.target);
        axis.quiet =
            if outputs.report.state == OperatingState::Enabled { 0 } else { axis.quiet + 1 };
        let AxisWatch { target, before, quiet } = *axis;
        (axis.before, axis.target) = (target, Some(request.target.0));
        let Some(target) = target else { return };
        let step = f64::from(request.target.0 - target);
        assert!(step.abs() <= self.velocity + 1.0, "a step of {step}");
        let may_move = quiet <= self.stop_ticks;
        assert!(may_move || step == 0.0, "a step of {step}, {quiet} ticks after ENABLED");
        let Some(before) = before else { return };
        let step_before = f64::from(target - before);
        assert!((step - step_before).abs() <= self.slow_down + 2.0, "from {step_before} to {step}");
    }
}

fn check_numbers(outputs: &CycleOutputs) {
    let Some(joint) = &outputs.report.joint else { return };
    let values = [
        joint.goal,
        joint.setpoint,
        joint.measured,
        joint.setpoint_velocity,
        joint.measured_velocity,
    ];
    assert!(values.iter().flatten().all(|value| value.is_finite()), "{joint:?}");
    assert!(joint.deviation.iter().all(|value| value.is_finite() && *value >= 0.0), "{joint:?}");
}

pub struct Recording {
    pub ticks: Vec<TickRecord>,
    pub snapshots: Vec<CycleSnapshot>,
    /// Selects the ticks whose snapshot is kept: a copy takes longer than a tick.
    pub(super) keeps: fn(usize) -> bool,
    pub offers: Vec<OfferRecord>,
    pub models: Vec<Vec<u8>>,
    offered: Option<u64>,
}

impl Recording {
    pub fn keeping(keeps: fn(usize) -> bool) -> Self {
        let (ticks, snapshots, offers, models) = Default::default();
        Self { ticks, snapshots, keeps, offers, models, offered: None }
    }

    pub(super) fn push(
        &mut self,
        now: Nanos,
        inputs: &CycleInputs,
        outputs: &CycleOutputs,
        snapshot: Option<CycleSnapshot>,
    ) {
        let tick = Tick { planned: now, started: now, missed: 0 };
        let timing = TickTiming { tick, ended: now };
        let (number, offered) = (outputs.requests[0].sequence, self.offered.take());
        self.ticks.push(TickRecord { number, offered, inputs: *inputs, outputs: *outputs, timing });
        self.snapshots.extend(snapshot);
    }

    fn keep(&mut self, model: &Model) {
        self.models.push(model.file().canonical_form().unwrap());
    }

    pub(super) fn offer(&mut self, candidate: &ModelCandidate) {
        let number = self.offers.len() as u64 + 1;
        let (model, carried) = (candidate.model().id(), candidate.state());
        self.offers.push(OfferRecord { number, model, carried });
        self.keep(candidate.model());
        self.offered = Some(number);
    }

    pub(super) fn black_box(mut self, first: &Model, config: &Config) -> BlackBox {
        self.keep(first);
        BlackBox {
            header: BlackBoxHeader { software: "test".to_owned(), ..BlackBoxHeader::default() },
            config: toml::to_string(config).unwrap(),
            models: self.models,
            offers: self.offers,
            snapshots: self.snapshots,
            ticks: self.ticks,
        }
    }
}
