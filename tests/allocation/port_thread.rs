//! A running port thread allocates nothing, be it in an exchange, a transition or a reconnection.
use std::io;

use i2ris::config::{Family, PortConfig};
use i2ris::drive::transport::Transport;
use i2ris::drive::{AxisLink, AxisPhase, AxisRequest, Demand, Port, PortEvent, PortRunner};
use i2ris::units::{Counts, Nanos};
use i2ris_simulation::{Emulator, Line};
use i2ris_testing::drive::{NODE, one_drive, *};
use i2ris_testing::emulation;

use crate::{allocations, uncounted};

/// The simulated line may allocate.
struct Uncounted(SimulatedLine);

impl Transport for Uncounted {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        uncounted(|| self.0.write(bytes))
    }

    fn read(&mut self, into: &mut [u8], deadline: Nanos) -> io::Result<usize> {
        uncounted(|| self.0.read(into, deadline))
    }

    fn now(&self) -> Nanos {
        self.0.now()
    }

    fn sleep_until(&mut self, until: Nanos) {
        uncounted(|| self.0.sleep_until(until));
    }
}

/// Runs turns until the axis is in a phase.
fn until<T: Transport>(
    runner: &mut PortRunner<T>,
    link: &mut AxisLink,
    request: &mut AxisRequest,
    phase: AxisPhase,
) {
    let mut ignore = |_: PortEvent| {};
    for _ in 0..20_000 {
        // As the control loop does in every tick.
        request.sequence += 1;
        link.requests.write(*request);
        runner.turn(&mut ignore);
        if link.feedback.read().phase == phase {
            return;
        }
    }
    panic!("never {phase:?}");
}

#[test]
fn port_thread_does_not_allocate_in_any_phase_or_fault() {
    let drive = one_drive();
    let config = port_config(std::slice::from_ref(&drive));
    let line = SimulatedLine::new(vec![drive]);
    let (mut runner, mut links) =
        Port::over(Uncounted(line.clone()), &config).bring_up().unwrap().split();
    let link = &mut links[0];
    let mut request = AxisRequest::default();
    let mut ignore = |_: PortEvent| {};

    let count = allocations(|| {
        until(&mut runner, link, &mut request, AxisPhase::Disabled);
        request.homings = 1;
        until(&mut runner, link, &mut request, AxisPhase::Homing);
        until(&mut runner, link, &mut request, AxisPhase::Disabled);
        request.demand = Demand::Enabled;
        until(&mut runner, link, &mut request, AxisPhase::Enabled);
        for target in 0..1000 {
            request.target = Counts(target);
            request.sequence += 1;
            link.requests.write(request);
            if target % 50 == 0 {
                uncounted(|| line.disturb([Disturbance::LoseReply, Disturbance::FlipReply(7)]));
            }
            runner.turn(&mut ignore);
        }
        uncounted(|| line.drive(NODE, |drive| drive.fail(0x8611)));
        until(&mut runner, link, &mut request, AxisPhase::Faulted);
        request.fault_resets = 1;
        request.demand = Demand::Disabled;
        until(&mut runner, link, &mut request, AxisPhase::Disabled);
        uncounted(|| line.state().silent = true);
        until(&mut runner, link, &mut request, AxisPhase::Lost);
        uncounted(|| line.state().silent = false);
        until(&mut runner, link, &mut request, AxisPhase::Disabled);
        request.demand = Demand::Enabled;
        until(&mut runner, link, &mut request, AxisPhase::Enabled);
        runner.shut_down(&mut ignore);
    });
    assert_eq!(count, 0);
}

#[test]
fn real_port_with_timeouts_does_not_allocate() {
    let (_folder, mut emulated) = emulation();
    emulated.connect(Line::Lab);
    let emulator = Emulator::start(emulated).unwrap();
    let mut drive = one_drive();
    drive.serial_number = 62_000_001;
    let config = PortConfig {
        device: emulator.device(0).to_owned(),
        family: Family::Epos2,
        baud: 1_000_000,
        reply_timeout_ms: 300,
        ..port_config(&[drive])
    };
    let (mut runner, mut links) = Port::open(&config).unwrap().bring_up().unwrap().split();
    let link = &mut links[0];
    let mut ignore = |_: PortEvent| {};
    let mut request = AxisRequest::default();

    let count = allocations(|| {
        until(&mut runner, link, &mut request, AxisPhase::Disabled);
        for _ in 0..100 {
            runner.turn(&mut ignore);
        }
        emulator.mute(0, true);
        until(&mut runner, link, &mut request, AxisPhase::Lost);
        emulator.mute(0, false);
        until(&mut runner, link, &mut request, AxisPhase::Disabled);
    });
    assert_eq!(count, 0);
}
