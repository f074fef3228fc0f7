//! Input devices played through pipes.

use std::fs::{File, OpenOptions};
use std::{io, os::unix::fs::OpenOptionsExt};

use i2ris::{clock, units::Nanos};
use i2ris_teleop::evdev_decoder::{encode, restamp};
use i2ris_teleop::recording::{write_frame, write_head};
use i2ris_teleop::{identity::Identity, state::Description};
use i2ris_testing::bench::WorkFolder;
use nix::sys::stat::Mode;

pub const KEY: u16 = 1;
pub const AXIS: u16 = 3;
pub const X: u16 = 0;
pub const Y: u16 = 1;
pub const BTN_EAST: u16 = 0x131;
pub const BTN_TR: u16 = 0x137;
pub const KEY_B: u16 = 48;
pub const KEY_C: u16 = 46;

pub fn identity(vendor: u16, product: u16, serial: &str) -> Identity {
    Identity { vendor, product, name: "Device".into(), serial: serial.into() }
}

pub fn pad(serial: &str) -> Description {
    Description::gamepad("Device", serial)
}

pub fn pedal() -> Description {
    Description::new(identity(0x0c45, 0x7403, ""), Vec::new(), vec![KEY_B, KEY_C])
}

pub struct Played {
    pub bench: WorkFolder,
    pipe: Option<File>,
}

impl Played {
    pub fn new(description: &Description) -> Self {
        let bench = WorkFolder::empty();
        nix::unistd::mkfifo(&bench.path("device"), Mode::S_IRUSR | Mode::S_IWUSR).unwrap();
        let mut played = Self { bench, pipe: None };
        played.plug_in(description);
        played
    }

    pub fn file(&self) -> String {
        self.bench.file("device")
    }

    /// Profile of a SpaceMouse that may be silent for longer than a loaded computer.
    pub fn patient_profile(&self) -> String {
        let shipped = include_str!("../../../../config/devices/spacemouse.toml");
        let patient = shipped.replace("silence_ms = 50\n", "silence_ms = 5000\n");
        assert_ne!(patient, shipped);
        std::fs::write(self.bench.path("mouse.toml"), patient).unwrap();
        self.bench.file("mouse.toml")
    }

    pub fn plug_in(&mut self, description: &Description) {
        // Reading as well, so that opening does not wait for the program.
        let mut options = OpenOptions::new();
        options.read(true).write(true).custom_flags(nix::libc::O_NONBLOCK);
        let mut pipe = options.open(self.bench.path("device")).unwrap();
        write_head(&mut pipe, description).unwrap();
        self.pipe = Some(pipe);
    }

    pub fn unplug(&mut self) {
        self.pipe = None;
    }

    pub fn report(&mut self, bytes: &[u8]) {
        self.try_report(bytes).unwrap();
    }

    pub fn try_report(&mut self, bytes: &[u8]) -> io::Result<()> {
        write_frame(self.pipe.as_mut().unwrap(), clock::now(), bytes)
    }

    /// A pad that is seen at rest.
    pub fn rest(&mut self) {
        self.send(AXIS, X, 0);
        self.send(AXIS, Y, 0);
        self.send(KEY, BTN_TR, 0);
    }

    /// An event, and the report that ends it.
    pub fn send(&mut self, kind: u16, code: u16, value: i32) {
        self.report(&[encode(kind, code, value), encode(0, 0, 0)].concat());
    }

    /// The same as the kernel would stamp it. Returns its time.
    pub fn report_stamped(&mut self, kind: u16, code: u16, value: i32) -> Nanos {
        let (now, mut event) =
            (clock::now(), [encode(kind, code, value), encode(0, 0, 0)].concat());
        restamp(&mut event, now);
        self.report(&event);
        Nanos(now.0 / 1000 * 1000)
    }
}
