//! The one table of the objects in the dictionaries of the drives, `objects.md`, for the driver,
//! the emulator, the doctor and the fingerprint. A row that cannot be read does not compile.

use crate::config::Family;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    U8,
    U16,
    U32,
    I8,
    I16,
    I32,
    /// Eight bytes: longer than a simple transfer can carry.
    U64,
    /// Text, or bytes of any length.
    Text,
}

impl Kind {
    /// Bytes of a value; 0: any number.
    pub const fn size(self) -> u8 {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 => 4,
            Self::U64 => 8,
            Self::Text => 0,
        }
    }

    /// The value in the low bytes of `raw`.
    pub const fn decode(self, raw: u32) -> i64 {
        match self {
            Self::U8 => raw as u8 as i64,
            Self::U16 => raw as u16 as i64,
            Self::U32 | Self::U64 | Self::Text => raw as i64,
            Self::I8 => raw as i8 as i64,
            Self::I16 => raw as i16 as i64,
            Self::I32 => raw as i32 as i64,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    Ro,
    Rw,
    Wo,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Entry {
    pub index: u16,
    pub subindex: u8,
    pub kind: Kind,
    pub access: Access,
    /// Value as delivered.
    pub default: i64,
    /// Lowest and highest value that the drive takes; `None`: all of the type, as far as known.
    pub range: Option<(i64, i64)>,
    /// Range and default differ between models, or between versions of the firmware. The range is
    /// then the widest known; only the drive itself knows its own.
    pub varies: bool,
    /// It changes while the drive is used: not a setting.
    pub live: bool,
    pub families: &'static [Family],
    /// The oldest firmware that is known to have it where an older one lacks it; 0: all have it.
    pub since: u16,
    /// Name for messages.
    pub name: &'static str,
    /// The key of the configuration that decides its value, or needs it to be read; empty: none.
    pub key: &'static str,
}

/// All objects that are used, by index and subindex.
pub const ALL: &[Entry] = &read_table();

pub fn find(family: Family, index: u16, subindex: u8) -> Option<&'static Entry> {
    of_family(family).find(|entry| (entry.index, entry.subindex) == (index, subindex))
}

/// All objects of a family, by index and subindex.
pub fn of_family(family: Family) -> impl Iterator<Item = &'static Entry> {
    ALL.iter().filter(move |entry| entry.families.contains(&family))
}

/// The first entry of an address: entries differ in range, default or family. A constant does not
/// compile if the object is not in the table.
pub(in crate::drive) const fn first(index: u16, subindex: u8) -> &'static Entry {
    let mut at = 0;
    while at < ALL.len() {
        if ALL[at].index == index && ALL[at].subindex == subindex {
            return &ALL[at];
        }
        at += 1;
    }
    panic!("not in the table of objects");
}

const TEXT: &str = include_str!("objects.md");

const ROWS: usize = {
    let (mut at, mut rows) = (0, 0);
    while at < TEXT.len() {
        rows += is_row(at) as usize;
        at += 1;
    }
    rows
};

/// Whether a line of an object begins here.
const fn is_row(at: usize) -> bool {
    let (text, is_line) = (TEXT.as_bytes(), at > 0 && TEXT.as_bytes()[at - 1] == b'\n');
    is_line && at + 3 < text.len() && text[at] == b'|' && text[at + 2] == b'0'
}

const fn read_table() -> [Entry; ROWS] {
    let mut table = [read_row(None); ROWS];
    let (mut at, mut row) = (0, 0);
    while at < TEXT.len() {
        if is_row(at) {
            table[row] = read_row(Some(at + 2));
            row += 1;
        }
        at += 1;
    }
    table
}

/// The object whose first cell begins here; `None`: an object without meaning.
const fn read_row(begin: Option<usize>) -> Entry {
    let mut cells = ["-"; 13];
    if let Some(mut at) = begin {
        let (text, mut cell) = (TEXT.as_bytes(), 0);
        while cell < cells.len() {
            let mut end = at;
            while text[end] != b' ' || text[end + 1] != b'|' {
                end += 1;
            }
            cells[cell] = TEXT.split_at(end).0.split_at(at).1;
            (at, cell) = (end + 3, cell + 1);
        }
    }
    let [index, sub, family, kind, access, default, low, high, varies, live, since, name, key] =
        cells;
    Entry {
        index: number(index) as u16,
        subindex: number(sub) as u8,
        kind: match kind.as_bytes() {
            [b'U', b'8'] => Kind::U8,
            [b'U', b'1', b'6'] => Kind::U16,
            [b'U', b'3', b'2'] => Kind::U32,
            [b'U', b'6', b'4'] => Kind::U64,
            [b'I', b'8'] => Kind::I8,
            [b'I', b'1', b'6'] => Kind::I16,
            [b'I', b'3', b'2'] => Kind::I32,
            [b'T', b'e', b'x', b't'] | [b'-'] => Kind::Text,
            _ => panic!("no type"),
        },
        access: match access.as_bytes() {
            [b'r', b'o'] | [b'-'] => Access::Ro,
            [b'r', b'w'] => Access::Rw,
            [b'w', b'o'] => Access::Wo,
            _ => panic!("no access"),
        },
        default: number(default),
        range: if is_set(low) { Some((number(low), number(high))) } else { None },
        varies: is_set(varies),
        live: is_set(live),
        families: match family.as_bytes() {
            [.., b'4'] => &[Family::Epos4],
            [.., b'2'] => &[Family::Epos2],
            _ => &[Family::Epos4, Family::Epos2],
        },
        since: number(since) as u16,
        name,
        key: if is_set(key) { key } else { "" },
    }
}

const fn is_set(cell: &str) -> bool {
    !matches!(cell.as_bytes(), [b'-'])
}

/// A decimal or hexadecimal number; 0 where the cell is not set.
const fn number(cell: &str) -> i64 {
    let (sign, digits) = match cell.as_bytes() {
        [b'-', digits @ ..] => (-1, digits),
        digits => (1, digits),
    };
    let (radix, digits) = match digits {
        [b'0', b'x', digits @ ..] => (16, digits),
        digits => (10, digits),
    };
    let (mut number, mut at) = (0, 0);
    while at < digits.len() {
        let Some(digit) = (digits[at] as char).to_digit(radix) else { panic!("no number") };
        number = number * radix as i64 + digit as i64;
        at += 1;
    }
    sign * number
}
