//! Objects of a real drive, as written by maxon's tool: EDS and DCF files (CiA 306), or a table of
//! such a file, `index,subindex,type,access,low,high,default,value` (CSV).
//!
//! If a file gives no range, the range in the table of objects applies, unless models differ.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use i2ris::drive::objects::{self, Access, Entry, Kind};

use super::family::Family;

/// The objects of a real drive.
#[derive(Debug, Clone, PartialEq)]
pub struct DeviceFile {
    pub family: Family,
    /// The objects, ordered by index and subindex.
    pub objects: Arc<[Entry]>,
}

/// Why a file holds no objects of a drive.
#[derive(Debug, thiserror::Error)]
#[error(
    "{}: {reason}; give a complete EDS or DCF file of an EPOS4 or EPOS2, or a table of one (CSV)",
    file.display()
)]
pub struct DeviceFileError {
    file: PathBuf,
    reason: String,
}

/// Objects that every drive has, in addition to its identity.
const ESSENTIAL: [u16; 6] = [0x6040, 0x6041, 0x6060, 0x6061, 0x6064, 0x607A];

/// The columns of a table, as an EDS names them.
const COLUMNS: &str =
    "index,subindex,datatype,accesstype,lowlimit,highlimit,defaultvalue,parametervalue";

/// The keys of an object, in lower case, with their values.
type Keys<'a> = BTreeMap<String, &'a str>;

impl DeviceFile {
    /// Reads a file.
    pub fn load(file: &Path) -> Result<Self, DeviceFileError> {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        std::fs::read(file)
            .map_err(|error| error.to_string())
            .and_then(|bytes| Self::parse(&String::from_utf8_lossy(&bytes), &name))
            .map_err(|reason| DeviceFileError { file: file.to_owned(), reason })
    }

    /// Reads a file. The firmware version of a table is the four digits after `fw` in its name.
    pub fn parse(text: &str, name: &str) -> Result<Self, String> {
        let (objects, product, firmware) = if text.starts_with("index,subindex,type,access") {
            let digits = name.split_once("fw").and_then(|(_, rest)| rest.get(..4));
            (read_csv(text)?, None, digits.and_then(|it| i64::from_str_radix(it, 16).ok()))
        } else {
            let sections = sections(text)?;
            let info = |key| number(sections.get("deviceinfo")?.get(key)?, Kind::U32);
            let upper = |key| info(key).map(|number| number >> 16);
            (read_eds(&sections)?, upper("productnumber"), upper("revisionnumber"))
        };
        let identity = [(0x1018, 1), (0x1018, 4)].into_iter();
        let mut essential = identity.chain(ESSENTIAL.map(|index| (index, 0)));
        if let Some((index, sub)) = essential.find(|it| !objects.contains_key(it)) {
            return Err(format!(
                "truncated, or not a drive file: object 0x{index:04X}:{sub:02X} is missing"
            ));
        }
        let is_epos2 = objects.contains_key(&(0x2062, 0));
        let family = if is_epos2 { Family::Epos2 } else { Family::Epos4 };
        let entry = |(address, keys)| {
            let derived = match address {
                (0x1018, 2) => Some(product.unwrap_or(0) << 16),
                (0x1018, 3) => firmware.map(|firmware| firmware << 16),
                (0x2003, 1) if is_epos2 => firmware,
                (0x2003, 2) if is_epos2 => product,
                _ => None,
            };
            entry(family, address, &keys, derived)
        };
        let objects: Result<_, String> = objects.into_iter().map(entry).collect();
        Ok(Self { family, objects: objects? })
    }
}

fn read_csv(text: &str) -> Result<BTreeMap<(u16, u8), Keys<'_>>, String> {
    let lines = text.lines().enumerate().skip(1).filter(|(_, line)| !line.trim().is_empty());
    lines
        .map(|(at, line)| {
            let fields: Vec<&str> = line.split(',').map(str::trim).collect();
            let address = fields.first().and_then(|index| number(index, Kind::U16));
            match (address.zip(fields.get(1).and_then(|sub| number(sub, Kind::U8))), fields.len()) {
                (Some((index, sub)), 8) => {
                    let keys = COLUMNS.split(',').map(str::to_owned).zip(fields);
                    Ok(((index as u16, sub as u8), keys.collect()))
                }
                _ => Err(format!("line {} is truncated, or not an object: `{line:.40}`", at + 1)),
            }
        })
        .collect()
}

/// The sections of a file by their names in lower case.
fn sections(text: &str) -> Result<BTreeMap<String, Keys<'_>>, String> {
    let (mut sections, mut name) = (BTreeMap::<String, Keys<'_>>::new(), String::new());
    for (at, line) in text.lines().enumerate() {
        let line = line.trim_start_matches('\u{feff}').trim();
        if let Some(next) = line.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
            name = next.to_lowercase();
            sections.entry(name.clone()).or_default();
        } else if let (Some(keys), Some((key, value))) =
            (sections.get_mut(&name), line.split_once('='))
        {
            keys.insert(key.trim().to_lowercase(), value.trim());
        } else if !line.is_empty() && !line.starts_with(';') {
            let what = if sections.is_empty() { "not an EDS file" } else { "truncated" };
            return Err(format!("{what}: line {} is `{line:.40}`", at + 1));
        }
    }
    Ok(sections)
}

/// The objects. All listed ones must exist: in a truncated file the last are missing.
fn read_eds<'a>(
    sections: &BTreeMap<String, Keys<'a>>,
) -> Result<BTreeMap<(u16, u8), Keys<'a>>, String> {
    let subs = |index: &str| {
        let prefix = format!("{index}sub");
        sections.keys().filter(|name| name.starts_with(&prefix)).count() as i64
    };
    for list in ["mandatoryobjects", "optionalobjects", "manufacturerobjects"] {
        let absent = || format!("not an EDS file, or truncated: [{list}] is missing or incomplete");
        let keys = sections.get(list).ok_or_else(absent)?;
        let listed = |key: &str| keys.get(key).and_then(|value| number(value, Kind::U32));
        let count = listed("supportedobjects").ok_or_else(absent)?;
        for at in 1..=count {
            let index = format!("{:04x}", listed(&at.to_string()).ok_or_else(absent)?);
            let keys = sections.get(&index);
            let least = keys.map(|keys| i64::from(keys.contains_key("subnumber")));
            if least.is_none_or(|least| subs(&index) < least) {
                return Err(format!("truncated: object 0x{index} is listed but missing"));
            }
        }
    }
    let address = |name: &str| {
        let (index, sub) = name.split_once("sub").unwrap_or((name, "0"));
        let sub = u8::from_str_radix(sub, 16).ok()?;
        u16::from_str_radix(index, 16).ok().filter(|_| index.len() == 4).map(|index| (index, sub))
    };
    let objects = sections.iter().filter(|(_, keys)| !keys.contains_key("subnumber"));
    Ok(objects.filter_map(|(name, keys)| Some((address(name)?, keys.clone()))).collect())
}

/// An object from its keys. `derived`: its value from elsewhere in the file.
fn entry(
    family: Family,
    address: (u16, u8),
    keys: &Keys<'_>,
    derived: Option<i64>,
) -> Result<Entry, String> {
    let (index, subindex) = address;
    let get = |key: &str| keys.get(key).copied().unwrap_or_default();
    let wrong = |key: &str| {
        let text = get(key);
        format!("object 0x{index:04X}:{subindex:02X} is truncated: {key} is `{text}`")
    };
    let kind = kind(get("datatype")).ok_or_else(|| wrong("datatype"))?;
    let access = match get("accesstype").to_lowercase().as_str() {
        "ro" | "const" => Access::Ro,
        "rw" | "rww" | "rwr" => Access::Rw,
        "wo" => Access::Wo,
        _ => return Err(wrong("accesstype")),
    };
    let value = |key: &str| match get(key) {
        "" => Ok(None),
        _ if kind == Kind::Text => Ok(None),
        text => number(text, kind).map(Some).ok_or_else(|| wrong(key)),
    };
    let known = objects::find(family.config(), index, subindex);
    let usual = known.filter(|known| !known.varies).and_then(|known| known.range);
    let range = match (value("lowlimit")?, value("highlimit")?) {
        (None, None) => usual,
        (low, high) => Some((low.unwrap_or(i64::MIN), high.unwrap_or(i64::MAX))),
    };
    let set = value("parametervalue")?.or(value("defaultvalue")?).or(derived);
    let default = set.or(known.map(|known| known.default)).unwrap_or(0);
    let known = known.unwrap_or(&objects::ALL[0]);
    Ok(Entry { index, subindex, kind, access, default, range, varies: false, ..*known })
}

/// The type by the name in a table, or the number in an EDS (CiA 301).
fn kind(text: &str) -> Option<Kind> {
    Some(match (text, number(text, Kind::U16)) {
        ("BOOL" | "U8", _) | (_, Some(0x1 | 0x5)) => Kind::U8,
        ("U16", _) | (_, Some(0x6)) => Kind::U16,
        ("U32", _) | (_, Some(0x7)) => Kind::U32,
        ("I8", _) | (_, Some(0x2)) => Kind::I8,
        ("I16", _) | (_, Some(0x3)) => Kind::I16,
        ("I32", _) | (_, Some(0x4 | 0x8)) => Kind::I32,
        ("U64" | "I64", _) | (_, Some(0x11 | 0x15 | 0x1B)) => Kind::U64,
        ("STR" | "OCTETS" | "DOMAIN", _) | (_, Some(0x9 | 0xA | 0xB | 0xF)) => Kind::Text,
        _ => return None,
    })
}

/// A number in the notation of these files: decimal, hexadecimal, after `$NODEID+`, and signed
/// numbers also as their bits (0xFFFF for -1). A semicolon starts a comment.
fn number(text: &str, kind: Kind) -> Option<i64> {
    let text = text.split(';').next()?.trim();
    let text = text.rsplit_once('+').map_or(text, |(_, offset)| offset.trim());
    let number = match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(digits) => u64::from_str_radix(digits, 16).ok()?.cast_signed(),
        None => text.parse().ok()?,
    };
    let bits = u32::try_from(number).ok().filter(|_| kind != Kind::U64);
    Some(bits.map_or(number, |bits| kind.decode(bits)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAMPLE: &str = include_str!("sample.eds");

    #[test]
    fn an_eds_becomes_the_objects_of_the_drive() {
        let file = DeviceFile::parse(SAMPLE, "drive.eds").unwrap();
        assert_eq!((file.family, file.objects.len()), (Family::Epos4, 29));
        for (address, kind, access, default, range) in [
            ((0x1018, 2), Kind::U32, Access::Ro, 0x6050_0000, None),
            ((0x1018, 3), Kind::U32, Access::Ro, 0x0110_0000, None),
            ((0x1014, 0), Kind::U32, Access::Ro, 0x80, None),
            ((0x2100, 1), Kind::U64, Access::Ro, 0, None),
            ((0x3001, 2), Kind::U32, Access::Rw, 3600, Some((0, 3600))),
            ((0x3001, 10), Kind::U8, Access::Wo, 1, Some((0, 255))),
            ((0x607F, 0), Kind::U32, Access::Rw, 12_000, Some((1, i64::MAX))),
            // The configured value counts. If the file gives no range, that of the family applies.
            ((0x6085, 0), Kind::U32, Access::Rw, 8000, Some((1, 0xFFFF_FFFF))),
            // Signed values, written as their bits.
            ((0x60B2, 0), Kind::I16, Access::Rw, -1, Some((-1000, 1000))),
        ] {
            let found = file.objects.iter().find(|it| (it.index, it.subindex) == address).unwrap();
            let Entry { kind: of, access: to, default: value, range: within, .. } = *found;
            assert_eq!((kind, access, default, range), (of, to, value, within), "{address:X?}");
        }
    }

    #[test]
    fn truncated_and_foreign_files_give_a_clear_error() {
        for at in 0..SAMPLE.len() - 100 {
            let cut = DeviceFile::parse(&SAMPLE[..at], "drive.eds").unwrap_err();
            assert!(cut.starts_with("not ") || cut.contains("truncated"), "{at}: {cut}");
        }
        let head = "index,subindex,type,access,low,high,default,value\n";
        for (text, part) in [
            ("robot_id = \"x\"", "not an EDS file: line 1"),
            ("\u{0}\u{1}\u{7f}ELF", "not an EDS file: line 1"),
            (&format!("{head}0x1000,0,U32,r"), "line 2 is truncated"),
            (&format!("{head}0x1000,0,U32,ro,,,,\n"), "object 0x1018:01 is missing"),
        ] {
            let error = DeviceFile::parse(text, "file").unwrap_err();
            assert!(error.contains(part), "{error}");
        }
    }
}
