//! One open device: a file that is read without waiting.

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Read};
use std::os::fd::{AsFd, AsRawFd, BorrowedFd};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use evdev::raw_stream::RawDevice;
use evdev::{FFEffect, FFEffectCode, FFEffectData, FFEffectKind, FFReplay, FFTrigger};
use i2ris::clock;
use i2ris::units::Nanos;

use crate::evdev_decoder::EvdevDecoder;
use crate::identity::Identity;
use crate::recording::{MAX_FRAME, Parser, RecordingError};
use crate::space_mouse;
use crate::state::{Description, DeviceState, Event, Protocol, Range};

/// Timeout for the head of a played recording when a program starts.
const HEAD: Nanos = Nanos::from_millis(10_000);
/// Maximum number of reads in a row, so that a device that never stops sending blocks nothing.
const AT_ONCE: usize = 16;
/// Duration of a vibration pulse, and its strength of 65535.
const PULSE_MS: u16 = 60;
const PULSE: u16 = 0x4000;
const HEAD_POLL: Nanos = Nanos::from_millis(5);

/// Error when opening or reading a device.
#[derive(Debug, thiserror::Error)]
pub enum DeviceError {
    #[error("{path}: {error}{remedy}", path = path.display(), remedy = remedy(error))]
    Io { path: PathBuf, error: io::Error },
    #[error(
        "{path} is {kind}, not an input device; `i2ris teleop input show` lists devices, `i2ris \
         teleop input play` plays a recording",
        path = path.display()
    )]
    NoDevice { path: PathBuf, kind: &'static str },
    #[error("{path}: {error}", path = path.display())]
    Recording { path: PathBuf, error: RecordingError },
    #[error("{path} is gone ({why})", path = path.display())]
    Gone { path: PathBuf, why: String },
}

fn remedy(error: &io::Error) -> &'static str {
    match error.kind() {
        ErrorKind::PermissionDenied => {
            "; install config/system/60-i2ris.rules (see its README), then plug the device in again"
        }
        ErrorKind::ResourceBusy => "; another program holds it (spacenavd? end it)",
        _ => "",
    }
}

/// An open device and its state.
#[derive(Debug)]
pub struct Device {
    path: PathBuf,
    description: Description,
    file: File,
    /// Keeps the grab.
    grabbed: Option<RawDevice>,
    /// Vibration pulse, if the device supports it.
    pulse: Option<FFEffect>,
    /// A recording that is played.
    played: Option<Parser>,
    decoder: EvdevDecoder,
    state: DeviceState,
}

impl Device {
    /// Opens `/dev/input/event*`, `/dev/hidraw*`, or a pipe through which a recording is played.
    pub fn open(path: &Path) -> Result<Self, DeviceError> {
        let failed = |error| DeviceError::Io { path: path.to_owned(), error };
        let kind = path.metadata().map_err(failed)?.file_type();
        if kind.is_fifo() {
            return Self::open_played(path, HEAD);
        }
        if !kind.is_char_device() {
            let kind = if kind.is_dir() { "a folder" } else { "a file" };
            return Err(DeviceError::NoDevice { path: path.to_owned(), kind });
        }
        // Write access is for pulses only; without permission there are none.
        let file = OpenOptions::new().read(true).write(true).custom_flags(FLAGS).open(path);
        let file = file.or_else(|_| open(path)).map_err(failed)?;
        if path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("hidraw")) {
            let description = space_mouse::description(hidraw_identity(path).map_err(failed)?);
            return Ok(Self::with(path, description, file, None));
        }
        let raw = { file.try_clone() }.and_then(|file| RawDevice::from_fd(file.into()));
        let raw = raw.map_err(failed)?;
        let description = describe(&raw).map_err(failed)?;
        monotonic(&file).map_err(failed)?;
        let mut device = Self::with(path, description, file, None);
        device.grabbed = Some(raw);
        Ok(device)
    }

    /// Whether this is a recording that is played.
    pub const fn is_played(&self) -> bool {
        self.played.is_some()
    }

    /// Opens a recording that is played through a pipe. Fails if no head comes within that time.
    pub(crate) fn open_played(path: &Path, within: Nanos) -> Result<Self, DeviceError> {
        let failed = |error| DeviceError::Io { path: path.to_owned(), error };
        let wrong = |error| DeviceError::Recording { path: path.to_owned(), error };
        let mut file = open(path).map_err(failed)?;
        let is_pipe = file.metadata().map_err(failed)?.file_type().is_fifo();
        let (mut parser, start) = (Parser::default(), clock::now());
        let mut buffer = [0; MAX_FRAME];
        loop {
            match file.read(&mut buffer) {
                Ok(0) => {}
                Ok(length) => parser.push(&buffer[..length]),
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                Err(error) => return Err(failed(error)),
            }
            if let Some(description) = parser.head().map_err(wrong)? {
                return Ok(Self::with(path, description, file, Some(parser)));
            }
            if clock::now().duration_since(start) >= within || !is_pipe {
                return Err(wrong(RecordingError::Head));
            }
            clock::sleep(HEAD_POLL);
        }
    }

    fn with(path: &Path, description: Description, file: File, played: Option<Parser>) -> Self {
        let (grabbed, pulse, decoder) = (None, None, EvdevDecoder::default());
        let (path, state) = (path.to_owned(), DeviceState::new(clock::now()));
        Self { path, description, file, grabbed, pulse, played, decoder, state }
    }

    /// Grabs the device: a pedal is a keyboard, and would type. Fails if another program has it.
    pub fn grab(&mut self) -> Result<(), DeviceError> {
        let path = &self.path;
        let grabbed = self.grabbed.as_mut().map_or(Ok(()), RawDevice::grab);
        grabbed.map_err(|error| DeviceError::Io { path: path.clone(), error })
    }

    /// Prepares vibration pulses; returns whether the device supports them.
    pub fn can_pulse(&mut self) -> bool {
        let pulse = FFEffectData {
            direction: 0,
            trigger: FFTrigger::default(),
            replay: FFReplay { length: PULSE_MS, delay: 0 },
            kind: FFEffectKind::Rumble { strong_magnitude: PULSE, weak_magnitude: PULSE },
        };
        let able = { self.grabbed.as_mut() }.filter(|raw| {
            raw.supported_ff().is_some_and(|effects| effects.contains(FFEffectCode::FF_RUMBLE))
        });
        self.pulse = able.and_then(|raw| raw.upload_ff_effect(pulse).ok());
        self.pulse.is_some()
    }

    /// Makes one pulse, if prepared.
    pub fn pulse(&mut self) {
        if let Some(pulse) = &mut self.pulse {
            // A lost device is detected by reading.
            let _ = pulse.play(1);
        }
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn description(&self) -> &Description {
        &self.description
    }

    pub fn parts(&mut self) -> (&Description, &mut DeviceState) {
        (&self.description, &mut self.state)
    }

    /// Reads without waiting; passes on every piece unchanged. Fails when the device is gone.
    pub fn read(&mut self, now: Nanos, mut raw: impl FnMut(&[u8])) -> Result<(), DeviceError> {
        // Frames may have come together with the head.
        self.play(&[], now, &mut raw)?;
        let mut buffer = [0; MAX_FRAME];
        for _ in 0..AT_ONCE {
            let gone = |why: String| DeviceError::Gone { path: self.path.clone(), why };
            let bytes = match self.file.read(&mut buffer) {
                Ok(0) => return Err(gone("closed".into())),
                Ok(length) => &buffer[..length],
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => return Err(gone(error.to_string())),
            };
            if self.is_played() {
                self.play(bytes, now, &mut raw)?;
            } else {
                raw(bytes);
                self.decode(bytes, now);
            }
        }
        Ok(())
    }

    /// Processes bytes of a recording that is played.
    fn play(
        &mut self,
        bytes: &[u8],
        now: Nanos,
        raw: &mut impl FnMut(&[u8]),
    ) -> Result<(), DeviceError> {
        self.played.iter_mut().for_each(|parser| parser.push(bytes));
        while let Some(parser) = &mut self.played {
            let wrong = |error| DeviceError::Recording { path: self.path.clone(), error };
            let Some((_, frame)) = parser.frame().map_err(wrong)? else { break };
            raw(&frame);
            self.decode(&frame, now);
        }
        Ok(())
    }

    fn decode(&mut self, bytes: &[u8], now: Nanos) {
        let apply = |event: Event| self.state.apply(event, now);
        let stamp = match self.description.protocol {
            Protocol::Evdev => {
                self.decoder.decode(bytes, apply);
                self.decoder.newest
            }
            // Reports have no timestamp.
            Protocol::SpaceMouse => {
                space_mouse::decode(bytes, apply);
                Some(now)
            }
        };
        self.state.newest = stamp.or(self.state.newest);
    }
}

impl AsFd for Device {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.file.as_fd()
    }
}

const FLAGS: libc::c_int = libc::O_NONBLOCK | libc::O_CLOEXEC;

fn open(path: &Path) -> io::Result<File> {
    OpenOptions::new().read(true).custom_flags(FLAGS).open(path)
}

fn describe(raw: &RawDevice) -> io::Result<Description> {
    let id = raw.input_id();
    let text = |text: Option<&str>| text.unwrap_or_default().to_owned();
    let range = |(code, axis): (evdev::AbsoluteAxisCode, evdev::AbsInfo)| Range {
        code: code.0,
        minimum: axis.minimum(),
        maximum: axis.maximum(),
        flat: axis.flat(),
    };
    let relative = raw.supported_relative_axes().into_iter().flat_map(|axes| axes.iter());
    let keys = raw.supported_keys().into_iter().flat_map(|keys| keys.iter());
    Ok(Description {
        identity: Identity {
            vendor: id.vendor(),
            product: id.product(),
            name: text(raw.name()),
            serial: text(raw.unique_name()),
        },
        protocol: Protocol::Evdev,
        absolute: raw.get_absinfo()?.map(range).collect(),
        relative: relative.map(|axis| axis.0).collect(),
        keys: keys.map(|key| key.0).collect(),
    })
}

/// Makes the kernel stamp events by the monotonic clock.
fn monotonic(file: &File) -> io::Result<()> {
    /// `_IOW('E', 0xa0, int)` of linux/input.h.
    const EVIOCSCLOCKID: libc::Ioctl = 0x4004_45a0;
    let clock: libc::c_int = libc::CLOCK_MONOTONIC;
    // SAFETY: the kernel reads one integer, which lives for the whole call.
    let outcome = unsafe { libc::ioctl(file.as_raw_fd(), EVIOCSCLOCKID, &raw const clock) };
    if outcome == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

/// Identity by the kernel in `/sys/class/hidraw`, without a request to the device.
fn hidraw_identity(path: &Path) -> io::Result<Identity> {
    let name = path.file_name().unwrap_or_default();
    let uevent_path = Path::new("/sys/class/hidraw").join(name).join("device/uevent");
    identity_of_uevent(&std::fs::read_to_string(uevent_path)?).ok_or_else(|| {
        io::Error::new(ErrorKind::InvalidData, "the kernel does not report its identity")
    })
}

fn identity_of_uevent(text: &str) -> Option<Identity> {
    let value = |key: &str| text.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('='));
    // Bus, vendor, product: 0003:0000256F:0000C635.
    let mut id = value("HID_ID")?.split(':').skip(1);
    let mut number = || u16::try_from(u32::from_str_radix(id.next()?, 16).ok()?).ok();
    let (vendor, product) = (number()?, number()?);
    let text = |key: &str| value(key).unwrap_or_default().to_owned();
    Some(Identity { vendor, product, name: text("HID_NAME"), serial: text("HID_UNIQ") })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::{write_frame, write_head};
    use crate::state::Code;
    use i2ris_needs::needs;

    #[test]
    fn hidraw_identity_comes_from_the_kernel() {
        let uevent = "DRIVER=hid-generic\nHID_ID=0003:0000256F:0000C635\nHID_NAME=3Dconnexion \
                      SpaceMouse Compact\nHID_UNIQ=\n";
        let identity = identity_of_uevent(uevent).unwrap();
        assert_eq!(identity.to_string(), "3Dconnexion SpaceMouse Compact (256f:c635)");
        assert_eq!(identity_of_uevent("HID_ID=0003:x"), None);
    }

    #[needs("device: /dev/uinput")]
    #[test]
    fn kernel_device_is_opened_grabbed_and_read_with_times() {
        use evdev::uinput::VirtualDevice;
        use evdev::{
            AbsInfo, AbsoluteAxisCode, AttributeSet, BusType, InputEvent, InputId, KeyCode,
            UinputAbsSetup,
        };
        let builder = VirtualDevice::builder().unwrap();
        let range = AbsInfo::new(0, -32768, 32767, 0, 128, 0);
        let keys: AttributeSet<KeyCode> = [KeyCode::BTN_SOUTH, KeyCode::BTN_TR].iter().collect();
        let mut kernel = builder
            .name("i2ris test pad")
            .input_id(InputId::new(BusType::BUS_USB, 0x045e, 0x02ea, 1))
            .with_absolute_axis(&UinputAbsSetup::new(AbsoluteAxisCode::ABS_X, range))
            .and_then(|builder| builder.with_keys(&keys))
            .and_then(evdev::uinput::VirtualDeviceBuilder::build)
            .unwrap();
        let path = kernel.enumerate_dev_nodes_blocking().unwrap().next().unwrap().unwrap();
        let mut device = Device::open(&path).unwrap();
        device.grab().unwrap();
        let description = device.description().clone();
        assert_eq!(description.identity.to_string(), "i2ris test pad (045e:02ea)");
        assert_eq!(description.range(0).map(|range| range.flat), Some(128));
        assert_eq!(description.keys.len(), 2);
        let before = clock::now();
        kernel.emit(&[InputEvent::new(3, 0, 12_345), InputEvent::new(1, 0x137, 1)]).unwrap();
        while device.parts().1.axis(Code::Absolute(0)).is_none() {
            device.read(clock::now(), |_| {}).unwrap();
            assert!(clock::now().duration_since(before) < HEAD, "nothing came");
            clock::sleep(HEAD_POLL);
        }
        let (_, state) = device.parts();
        assert!(state.is_pressed(0x137));
        // Microseconds are cut off.
        let came = state.newest.take().unwrap();
        assert!(came + Nanos::from_micros(1) > before && came <= clock::now());
        drop(kernel);
        let gone = (0..1000).any(|_| {
            clock::sleep(HEAD_POLL);
            device.read(clock::now(), |_| {}).is_err()
        });
        assert!(gone);
    }

    #[test]
    fn long_burst_is_read_in_pieces_without_loss() {
        let (reader, mut writer) = io::pipe().unwrap();
        // SAFETY: asks for the size of an open pipe.
        let size = unsafe { libc::fcntl(writer.as_raw_fd(), libc::F_SETPIPE_SZ, 1 << 20) };
        assert!(size > 0);
        let identity = Identity::new(0x256f, 0xc635, "Mouse");
        write_head(&mut writer, &space_mouse::description(identity)).unwrap();
        for x in 0..20_000_i16 {
            let [low, high] = x.to_le_bytes();
            write_frame(&mut writer, Nanos::ZERO, &[1, low, high, 0, 0, 0, 0]).unwrap();
        }
        let path = PathBuf::from(format!("/proc/self/fd/{}", reader.as_raw_fd()));
        let mut device = Device::open(&path).unwrap();
        let mut read = || {
            device.read(clock::now(), |_| {}).unwrap();
            device.parts().1.axis(Code::Absolute(0)).unwrap().value
        };
        assert!(read() < 19_999, "the other devices wait for all events");
        assert_eq!((0..10).map(|_| read()).last(), Some(19_999));
    }

    #[test]
    fn frame_that_arrives_with_the_head_is_read() {
        let (reader, mut writer) = io::pipe().unwrap();
        let identity = Identity::new(0x256f, 0xc635, "Mouse");
        write_head(&mut writer, &space_mouse::description(identity)).unwrap();
        write_frame(&mut writer, Nanos::ZERO, &[1, 7, 0, 0, 0, 0, 0]).unwrap();
        let path = PathBuf::from(format!("/proc/self/fd/{}", reader.as_raw_fd()));
        let mut device = Device::open(&path).unwrap();
        device.read(clock::now(), |_| {}).unwrap();
        assert_eq!(device.parts().1.axis(Code::Absolute(0)).unwrap().value, 7);
    }
}
