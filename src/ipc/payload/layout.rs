//! The fields of payloads: name, type, number of entries, offset. Schemas, tables and the payloads
//! of other languages are made of them.

/// The type of one entry of a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FieldType {
    /// `uint8`.
    U8,
    /// `uint16`.
    U16,
    /// `uint32`.
    U32,
    /// `int32`.
    I32,
    /// `uint64`.
    U64,
    /// `float64`.
    F64,
    /// Another payload.
    Payload(&'static PayloadLayout),
}

impl FieldType {
    /// Size of one entry, bytes.
    #[must_use]
    pub const fn size(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 => 2,
            Self::U32 | Self::I32 => 4,
            Self::U64 | Self::F64 => 8,
            Self::Payload(payload) => payload.size,
        }
    }
}

/// One field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// Type of one entry.
    pub kind: FieldType,
    /// Number of entries, of nested arrays too.
    pub count: usize,
    /// Offset from the start of the payload, bytes.
    pub offset: usize,
}

/// The fields of one payload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PayloadLayout {
    /// Its name in Rust, Python and C++.
    pub name: &'static str,
    /// Its name in iceoryx2, with the version.
    pub type_name: &'static str,
    /// Its size, bytes.
    pub size: usize,
    /// Fields in the order of memory.
    pub fields: &'static [Field],
}

impl PayloadLayout {
    /// All numbers in the order of memory: fields of other payloads in place of these, as
    /// `NAME_MEMBER`.
    #[must_use]
    pub fn numbers(&self) -> Vec<(String, Field)> {
        let mut numbers = Vec::new();
        for field in self.fields {
            let FieldType::Payload(payload) = field.kind else {
                numbers.push((field.name.to_owned(), *field));
                continue;
            };
            for entry in 0..field.count {
                let offset = field.offset + entry * payload.size;
                numbers.extend(payload.numbers().into_iter().map(|(name, member)| {
                    let name = format!("{}_{name}", field.name);
                    (name, Field { offset: offset + member.offset, ..member })
                }));
            }
        }
        numbers
    }
}

/// A type that a field can have.
pub(super) trait FieldValue {
    /// Type of one entry.
    const KIND: FieldType;
    /// Number of entries.
    const COUNT: usize = 1;
}

macro_rules! primitives {
    ($($type:ty => $kind:ident),*) => {
        $(impl FieldValue for $type {
            const KIND: FieldType = FieldType::$kind;
        })*
    };
}

primitives!(u8 => U8, u16 => U16, u32 => U32, i32 => I32, u64 => U64, f64 => F64);

impl<T: FieldValue, const N: usize> FieldValue for [T; N] {
    const KIND: FieldType = T::KIND;
    const COUNT: usize = N * T::COUNT;
}
