//! A drive with a dictionary, the CiA 402 machine, and a motor without inertia.

use std::collections::BTreeMap;

/// States by their statusword patterns.
pub const SWITCH_ON_DISABLED: u16 = 0x0240;
pub const READY: u16 = 0x0221;
pub const SWITCHED_ON: u16 = 0x0233;
pub const OPERATION_ENABLED: u16 = 0x0237;
pub const QUICK_STOP_ACTIVE: u16 = 0x0217;
pub const FAULT: u16 = 0x0208;

const CONTROLWORD: (u16, u8) = (0x6040, 0);
const STATUSWORD: (u16, u8) = (0x6041, 0);
const MODE: (u16, u8) = (0x6060, 0);
const MODE_DISPLAY: (u16, u8) = (0x6061, 0);
const POSITION: (u16, u8) = (0x6064, 0);
const TARGET: (u16, u8) = (0x607A, 0);
const ERROR_CODE: (u16, u8) = (0x603F, 0);

/// The data of a reply, without the heap: tests count allocations.
#[derive(Clone, Copy)]
pub struct Reply {
    bytes: [u8; 24],
    length: usize,
}

impl Reply {
    pub fn data(&self) -> &[u8] {
        &self.bytes[..self.length]
    }

    pub fn error(code: u32) -> Self {
        Self::new(code, &[])
    }

    fn new(code: u32, rest: &[u8]) -> Self {
        let mut bytes = [0; 24];
        bytes[..4].copy_from_slice(&code.to_le_bytes());
        bytes[4..4 + rest.len()].copy_from_slice(rest);
        Self {
            bytes,
            length: 4 + rest.len(),
        }
    }
}

#[derive(Debug)]
pub struct MiniDrive {
    pub node: u8,
    pub serial_number: u32,
    pub objects: BTreeMap<(u16, u8), u32>,
    /// Statusword without mode bits.
    pub state: u16,
    pub homed: bool,
    /// Where the motor stands.
    pub position: i32,
    /// Modes are taken, but do not come into force.
    pub mode_stuck: bool,
    /// Commands to the state machine have no effect.
    pub stuck: bool,
    /// The cause of the fault is still there: a reset has no effect.
    pub cause_remains: bool,
    /// Homing fails.
    pub homing_fails: bool,
    /// Objects that refuse to be written, with the code.
    pub refuses: BTreeMap<(u16, u8), u32>,
    /// Objects that take a write but keep their value.
    pub ignores: Vec<(u16, u8)>,
    /// Every write that was carried out: index, subindex, value.
    pub writes: Vec<(u16, u8, u32)>,
    /// Every position tells how many requests came before it.
    pub counting: bool,
    pub requests: u32,
    /// Times that the motor was powered in mode 8 with another target than its position: jumps.
    pub jumps: u32,
    /// Times that a start was commanded in another mode than homing, where it means something else.
    pub starts_outside_homing: u32,
    homing_bits: u16,
}

impl MiniDrive {
    pub fn new(node: u8, serial_number: u32) -> Self {
        let mut drive = Self {
            node,
            serial_number,
            objects: BTreeMap::new(),
            state: SWITCH_ON_DISABLED,
            homed: true,
            position: 0,
            mode_stuck: false,
            stuck: false,
            cause_remains: false,
            homing_fails: false,
            refuses: BTreeMap::new(),
            ignores: Vec::new(),
            writes: Vec::with_capacity(100_000),
            counting: false,
            requests: 0,
            jumps: 0,
            starts_outside_homing: 0,
            homing_bits: 0,
        };
        drive.defaults();
        drive
    }

    /// Power off and on again.
    pub fn restart(&mut self) {
        self.defaults();
        self.state = SWITCH_ON_DISABLED;
        self.homed = false;
    }

    pub fn fail(&mut self, code: u16) {
        self.state = FAULT;
        self.objects.insert(ERROR_CODE, u32::from(code));
    }

    pub fn target(&self) -> i32 {
        self.objects[&TARGET] as i32
    }

    /// The values that were written to an object, in order.
    pub fn written(&self, index: u16, subindex: u8) -> Vec<u32> {
        let wanted = |write: &&(u16, u8, u32)| (write.0, write.1) == (index, subindex);
        self.writes
            .iter()
            .filter(wanted)
            .map(|write| write.2)
            .collect()
    }

    fn defaults(&mut self) {
        for (index, subindex, value) in [
            (0x1018, 1, 0xFB),
            (0x1018, 2, 0x6150_0000),
            (0x1018, 3, 0x0170_0000),
            (0x2005, 0, 500),
            (0x2006, 0, 500),
            (0x3001, 2, 15_000),
            (0x30B0, 0, 0),
            (0x30D1, 2, 12),
            (0x603F, 0, 0),
            (0x6040, 0, 0),
            (0x605A, 0, 6),
            (0x605C, 0, 1),
            (0x605E, 0, 2),
            (0x6060, 0, 1),
            (0x6061, 0, 1),
            (0x6065, 0, 2000),
            (0x607A, 0, 777),
            (0x607D, 1, 0),
            (0x607D, 2, 0),
            (0x607F, 0, 50_000),
            (0x6080, 0, 50_000),
            (0x6085, 0, 10_000),
            (0x6098, 0, 7),
            (0x60C2, 1, 0),
        ] {
            self.objects.insert((index, subindex), value);
        }
        self.objects.insert((0x1018, 4), self.serial_number);
    }

    pub fn read(&mut self, index: u16, subindex: u8) -> Reply {
        self.requests += 1;
        let value = match (index, subindex) {
            STATUSWORD => {
                u32::from(self.state | u16::from(self.homed) << 15 | self.homing_bits) | 0xABCD_0000
            }
            POSITION if self.counting => self.requests,
            POSITION => self.position as u32,
            object => match self.objects.get(&object) {
                Some(value) => *value,
                None => return Reply::error(0x0602_0000),
            },
        };
        Reply::new(0, &value.to_le_bytes())
    }

    pub fn read_long(&mut self, index: u16, subindex: u8) -> Reply {
        match (index, subindex) {
            (0x2100, 1) => Reply::new(0, &[8, 0, 0, 0, 8, 1, 2, 3, 4, 5, 6, 7, 8, 0]),
            (0x1008, 0) => Reply::new(0, &[5, 0, 0, 0, 5, b'E', b'P', b'O', b'S', b'4']),
            _ => Reply::error(0x0602_0000),
        }
    }

    pub fn write(&mut self, index: u16, subindex: u8, value: u32) -> Reply {
        self.requests += 1;
        let object = (index, subindex);
        if let Some(code) = self
            .refuses
            .get(&object)
            .copied()
            .or_else(|| self.objection(object, value))
        {
            return Reply::error(code);
        }
        self.writes.push((index, subindex, value));
        if object == CONTROLWORD {
            self.command(self.objects[&CONTROLWORD] as u16, value as u16);
        }
        if !self.ignores.contains(&object) {
            self.objects.insert(object, value);
        }
        if !self.mode_stuck {
            self.objects.insert(MODE_DISPLAY, self.objects[&MODE]);
        }
        self.follow();
        Reply::error(0)
    }

    fn objection(&self, object: (u16, u8), value: u32) -> Option<u32> {
        let limit = |subindex| self.objects[&(0x607D, subindex)] as i32;
        match object {
            STATUSWORD | POSITION | ERROR_CODE | (0x1018, _) => Some(0x0601_0002),
            (0x607D, 1) if limit(2) != 0 && value as i32 > limit(2) => Some(0x0609_0030),
            (0x607D, 2) if limit(1) != 0 && limit(1) > value as i32 => Some(0x0609_0030),
            MODE if !matches!(value, 1 | 3 | 6 | 8 | 9 | 10) => Some(0x0609_0030),
            object if !self.objects.contains_key(&object) => Some(0x0602_0000),
            _ => None,
        }
    }

    fn command(&mut self, before: u16, word: u16) {
        let rises = |bit: u16| word >> bit & 1 == 1 && before >> bit & 1 == 0;
        if self.stuck {
            return;
        }
        let from = self.state;
        self.state = match (word & 0x008F, self.state) {
            (0x0080, FAULT) if rises(7) && !self.cause_remains => {
                self.objects.insert(ERROR_CODE, 0);
                SWITCH_ON_DISABLED
            }
            (0x0006, SWITCH_ON_DISABLED | SWITCHED_ON | OPERATION_ENABLED) => READY,
            (0x0007, READY | OPERATION_ENABLED) => SWITCHED_ON,
            (0x000F, READY | SWITCHED_ON | QUICK_STOP_ACTIVE) => OPERATION_ENABLED,
            (0x0000, READY | SWITCHED_ON | OPERATION_ENABLED | QUICK_STOP_ACTIVE) => {
                SWITCH_ON_DISABLED
            }
            (0x0002 | 0x000B, READY | SWITCHED_ON) => SWITCH_ON_DISABLED,
            (0x0002 | 0x000B, OPERATION_ENABLED) => QUICK_STOP_ACTIVE,
            (_, state) => state,
        };
        if from != OPERATION_ENABLED && self.state == OPERATION_ENABLED && self.objects[&MODE] == 8
        {
            self.jumps += u32::from(self.target() != self.position);
        }
        self.starts_outside_homing += u32::from(rises(4) && self.objects[&MODE] != 6);
        if rises(4) && self.state == OPERATION_ENABLED && self.objects[&MODE] == 6 {
            self.home();
        }
    }

    fn home(&mut self) {
        if self.homing_fails {
            self.homing_bits = 1 << 13;
        } else if self.objects[&(0x6098, 0)] == 37 {
            self.position = self.objects[&(0x30B0, 0)] as i32;
            self.homed = true;
            self.homing_bits = 1 << 10 | 1 << 12;
        }
    }

    fn follow(&mut self) {
        if self.objects[&MODE] != 6 {
            self.homing_bits = 0;
        }
        if self.state == OPERATION_ENABLED && self.objects[&MODE] == 8 {
            self.position = self.target();
        }
    }
}
