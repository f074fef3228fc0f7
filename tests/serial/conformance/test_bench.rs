//! Emulated drives in a topology.

use std::time::Duration;

use i2ris_simulation::drive::DriveSnapshot;
use tempfile::TempDir;

use super::*;

/// Long enough for any stall of the machine.
pub const PATIENCE: Duration = Duration::from_secs(30);

/// Serial numbers of the emulated drives.
pub const SERIAL_NUMBERS: [u32; 3] = [62_000_001, 62_000_002, 62_000_003];

/// Family and topology of the drive under test.
#[derive(Debug, Clone, Copy)]
pub struct Setup {
    pub name: &'static str,
    /// The family of the drive that the port belongs to.
    pub port: Family,
    /// The family of the drive under test.
    pub drive: Family,
    pub streaming: Streaming,
    /// The number of the drive under test: the first is on the port, others are reached through it.
    pub drives_before: usize,
}

const EPOS4: Setup = Setup {
    name: "EPOS4",
    port: Family::Epos4,
    drive: Family::Epos4,
    streaming: Streaming::Cyclic,
    drives_before: 0,
};

const EPOS2: Setup = Setup { name: "EPOS2", port: Family::Epos2, drive: Family::Epos2, ..EPOS4 };

pub const SETUPS: [Setup; 7] = [
    EPOS4,
    Setup { name: "EPOS4, profile", streaming: Streaming::Profile, ..EPOS4 },
    Setup { name: "EPOS4, gateway", drives_before: 1, ..EPOS4 },
    EPOS2,
    Setup { name: "EPOS2, gateway", drives_before: 1, ..EPOS2 },
    Setup { name: "EPOS2 behind EPOS4", drive: Family::Epos2, drives_before: 1, ..EPOS4 },
    // The auxiliary axis, on the laboratory's line.
    Setup { name: "EPOS2, third on a line", drives_before: 2, ..EPOS2 },
];

/// Drives, one of them under test.
pub struct TestBench {
    emulator: Emulator,
    ports: Vec<PortConfig>,
    /// The axis under test.
    pub axis: usize,
    pub streaming: Streaming,
    _folder: TempDir,
}

impl TestBench {
    pub fn emulated(setup: &Setup) -> Self {
        Self::with(setup, |_| {})
    }

    pub fn with(setup: &Setup, change: impl FnOnce(&mut EmulatorConfig)) -> Self {
        let (folder, mut config) = emulation();
        let axis = setup.drives_before;
        config.drives.iter_mut().for_each(|drive| drive.family = emulated_family(setup.port));
        if setup.port == Family::Epos2 {
            config.line = LineConfig::usb();
        }
        match axis {
            0 => {}
            1 => {
                config.gateway_us = Some(600);
                config.drives[1].node_id = 2;
            }
            _ => config.add_auxiliary(600),
        }
        let tested = config.auxiliary.as_mut().unwrap_or(&mut config.drives[axis % 2]);
        tested.family = emulated_family(setup.drive);
        // A hard stop for homing, reached within a second.
        tested.motor.stops = [-400.0, 100_000.0];
        change(&mut config);
        let emulator = Emulator::start(config).unwrap();
        let ports = ports(setup, &emulator);
        Self { emulator, ports, axis, streaming: setup.streaming, _folder: folder }
    }

    pub fn emulator(&self) -> &Emulator {
        &self.emulator
    }

    /// The port with the axis under test.
    pub fn port(&self) -> PortConfig {
        self.ports
            .iter()
            .find(|port| port.axes.iter().any(|axis| axis.motor == self.axis))
            .unwrap()
            .clone()
    }

    /// The port with the axis under test changed.
    pub fn port_with(&self, change: impl FnOnce(&mut AxisConfig)) -> PortConfig {
        let mut port = self.port();
        let mut axes = port.axes.iter_mut();
        change(axes.find(|axis| axis.motor == self.axis).unwrap());
        port
    }

    pub fn bring_up(&self) -> Result<ReadyPort, DriveError> {
        Port::open(&self.port())?.bring_up()
    }

    pub fn run(&self) -> RunningAxis {
        self.run_with(&self.port())
    }

    pub fn enabled(&self) -> RunningAxis {
        let mut axis = self.run();
        axis.enable();
        axis
    }

    pub fn run_with(&self, port: &PortConfig) -> RunningAxis {
        RunningAxis::start(Port::open(port).unwrap().bring_up().unwrap(), self.axis)
    }

    /// The emulated drive under test.
    pub fn drive(&self) -> DriveSnapshot {
        let snapshot = self.emulator().snapshot();
        snapshot.auxiliary.unwrap_or_else(|| snapshot.axes[self.axis].drive)
    }

    /// Setpoints that reached the drive under test.
    pub fn setpoints(&self) -> Vec<i32> {
        let events = self.emulator().log().into_iter().filter(|event| event.axis == self.axis);
        let setpoints = events.filter_map(|event| match event.kind {
            EventKind::Setpoint(counts) => Some(counts),
            _ => None,
        });
        setpoints.collect()
    }

    /// The host never sent a request before the previous reply, and never an unknown request.
    pub fn assert_no_host_bugs(&self) {
        let mut log = self.emulator.log();
        log.retain(|event| matches!(event.kind, EventKind::HostBug(_)));
        assert!(log.is_empty(), "{log:?}");
    }
}

fn emulated_family(family: Family) -> i2ris_simulation::drive::Family {
    match family {
        Family::Epos4 => i2ris_simulation::drive::Family::Epos4,
        Family::Epos2 => i2ris_simulation::drive::Family::Epos2,
    }
}

fn ports(setup: &Setup, emulator: &Emulator) -> Vec<PortConfig> {
    let axis = |motor: usize| AxisConfig {
        node_id: motor as u8 + 1,
        ..fast_axis(motor, SERIAL_NUMBERS[motor], [Counts(-2400), Counts(2400)])
    };
    let tested = AxisConfig {
        family: (setup.drive != setup.port).then_some(setup.drive),
        streaming: setup.streaming,
        ..axis(setup.drives_before)
    };
    let axes = (0..setup.drives_before).map(axis).chain([tested]).collect();
    vec![PortConfig {
        family: setup.port,
        // A real drive answers within 5 ms. A test machine stalls for 100 ms, and an early retry
        // would count as an error of the host.
        reply_timeout_ms: 1000,
        ..PortConfig::new(emulator.device(0).to_owned(), axes)
    }]
}
