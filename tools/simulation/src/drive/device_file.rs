//! Objects of a real drive, as maxon's tool wrote them: EDS and DCF files (CiA 306), or a table of
//! such a file, `index,subindex,type,access,low,high,default,value` (CSV).
//!
//! Where a file gives no range, that of the table of objects holds, unless models differ in it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use i2ris::drive::objects::{self, Access, Entry, Kind};

use super::family::Family;

/// The objects of a real drive.
#[derive(Debug, Clone, PartialEq)]
pub struct DeviceFile {
    pub family: Family,
    /// By index and subindex.
    pub objects: Arc<[Entry]>,
}

/// Why a file holds no objects of a drive.
#[derive(Debug, thiserror::Error)]
#[error(
    "{}: {reason}; give a whole EDS or DCF file of an EPOS4 or EPOS2, or a table of one (CSV)",
    file.display()
)]
pub struct DeviceFileError {
    file: PathBuf,
    reason: String,
}

/// Without these nothing is a drive.
const ESSENTIAL: [(u16, u8); 8] = [
    (0x1018, 1),
    (0x1018, 4),
    (0x6040, 0),
    (0x6041, 0),
    (0x6060, 0),
    (0x6061, 0),
    (0x6064, 0),
    (0x607A, 0),
];

const CSV_HEAD: &str = "index,subindex,type,access,low,high,default,value";

/// Keys of a section of an EDS file, in lower case, with their values.
type Keys<'a> = BTreeMap<String, &'a str>;

/// An object as the file writes it.
#[derive(Default)]
struct Row<'a> {
    kind: &'a str,
    access: &'a str,
    low: &'a str,
    high: &'a str,
    value: &'a str,
}

impl DeviceFile {
    /// Reads a file.
    pub fn load(file: &Path) -> Result<Self, DeviceFileError> {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        std::fs::read(file)
            .map_err(|error| error.to_string())
            .and_then(|bytes| Self::parse(&String::from_utf8_lossy(&bytes), &name))
            .map_err(|reason| DeviceFileError { file: file.to_owned(), reason })
    }

    /// Reads the content of a file. A table says nothing about the firmware: it is the four digits
    /// after `fw` in the name of the file.
    pub fn parse(text: &str, name: &str) -> Result<Self, String> {
        let (rows, product, firmware) = if text.starts_with(CSV_HEAD) {
            let digits = name.split_once("fw").and_then(|(_, rest)| rest.get(..4));
            let firmware = digits.and_then(|digits| i64::from_str_radix(digits, 16).ok());
            (read_csv(text)?, None, firmware)
        } else {
            let sections = sections(text)?;
            let info = |key| {
                let keys = sections.iter().find(|(name, _)| name == "deviceinfo");
                keys.and_then(|(_, keys)| number(keys.get(key)?, Kind::U32)).map(|it| it >> 16)
            };
            let (product, firmware) = (info("productnumber"), info("revisionnumber"));
            (read_eds(&sections)?, product, firmware)
        };
        if let Some((index, sub)) = ESSENTIAL.iter().find(|&address| !rows.contains_key(address)) {
            return Err(format!(
                "it is cut, or of no drive: object 0x{index:04X}:{sub:02X} is absent"
            ));
        }
        let is_epos2 = rows.contains_key(&(0x2062, 0));
        let family = if is_epos2 { Family::Epos2 } else { Family::Epos4 };
        let entry = |(address, row)| {
            let mut entry = entry(family, address, &row)?;
            let known = match address {
                (0x1018, 2) => Some(product.unwrap_or(0) << 16),
                (0x1018, 3) => firmware.map(|firmware| firmware << 16),
                (0x2003, 1) if is_epos2 => firmware,
                (0x2003, 2) if is_epos2 => product,
                _ => None,
            };
            if let Some(known) = known.filter(|_| row.value.is_empty()) {
                entry.default = known;
            }
            Ok(entry)
        };
        let objects: Result<_, String> = rows.into_iter().map(entry).collect();
        Ok(Self { family, objects: objects? })
    }
}

fn read_csv(text: &str) -> Result<BTreeMap<(u16, u8), Row<'_>>, String> {
    let lines = text.lines().enumerate().skip(1).filter(|(_, line)| !line.trim().is_empty());
    lines
        .map(|(at, line)| {
            let fields: Vec<&str> = line.split(',').map(str::trim).collect();
            let &[index, sub, kind, access, low, high, default, value] = fields.as_slice() else {
                return Err(format!("line {} is cut: {line}", at + 1));
            };
            let address = number(index, Kind::U16).zip(number(sub, Kind::U8));
            let address = address.ok_or_else(|| format!("line {} has no address", at + 1))?;
            let value = if value.is_empty() { default } else { value };
            Ok(((address.0 as u16, address.1 as u8), Row { kind, access, low, high, value }))
        })
        .collect()
}

/// The sections of a file in their order, by their names in lower case.
fn sections(text: &str) -> Result<Vec<(String, Keys<'_>)>, String> {
    let mut sections: Vec<(String, Keys<'_>)> = Vec::new();
    for (at, line) in text.lines().enumerate() {
        let line = line.trim_start_matches('\u{feff}').trim();
        if line.is_empty() || line.starts_with(';') {
            continue;
        }
        if let Some(name) = line.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
            sections.push((name.to_lowercase(), Keys::new()));
        } else if let (Some((_, keys)), Some((key, value))) =
            (sections.last_mut(), line.split_once('='))
        {
            keys.insert(key.trim().to_lowercase(), value.trim());
        } else {
            let what = if sections.is_empty() { "it is no EDS" } else { "it is cut" };
            return Err(format!("{what}: line {} is `{line:.40}`", at + 1));
        }
    }
    Ok(sections)
}

fn read_eds<'a>(sections: &[(String, Keys<'a>)]) -> Result<BTreeMap<(u16, u8), Row<'a>>, String> {
    let by_name: BTreeMap<&str, &Keys<'_>> =
        sections.iter().map(|(name, keys)| (name.as_str(), keys)).collect();
    for list in ["MandatoryObjects", "OptionalObjects", "ManufacturerObjects"] {
        let absent = || format!("it is no EDS, or cut: [{list}] is absent or not whole");
        let keys = by_name.get(list.to_lowercase().as_str()).ok_or_else(absent)?;
        let listed = |key: &str| keys.get(key).and_then(|value| number(value, Kind::U32));
        for at in 1..=listed("supportedobjects").ok_or_else(absent)? {
            let index = listed(&at.to_string()).ok_or_else(absent)?;
            if !by_name.contains_key(format!("{index:04x}").as_str()) {
                return Err(format!("it is cut: object 0x{index:04X} is listed, but absent"));
            }
        }
    }
    // The last record may be cut.
    if let Some((index, _)) = sections.last().and_then(|(name, _)| name.split_once("sub"))
        && let Some(count) = by_name.get(index).and_then(|keys| keys.get("subnumber"))
    {
        let prefix = format!("{index}sub");
        let found = by_name.keys().filter(|name| name.starts_with(&prefix)).count();
        if number(count, Kind::U8).is_some_and(|count| (found as i64) < count) {
            return Err(format!("it is cut: object 0x{index} has {found} of {count} subindices"));
        }
    }
    let mut rows = BTreeMap::new();
    for (name, keys) in sections {
        let (index, sub) = name.split_once("sub").unwrap_or((name, "0"));
        let address = (u16::from_str_radix(index, 16), u8::from_str_radix(sub, 16));
        let (4, (Ok(index), Ok(sub))) = (index.len(), address) else {
            continue;
        };
        let get = |key: &str| keys.get(key).copied().unwrap_or_default();
        if !get("subnumber").is_empty() {
            continue;
        }
        let value = match get("parametervalue") {
            "" => get("defaultvalue"),
            value => value,
        };
        let (low, high) = (get("lowlimit"), get("highlimit"));
        let (kind, access) = (get("datatype"), get("accesstype"));
        rows.insert((index, sub), Row { kind, access, low, high, value });
    }
    Ok(rows)
}

fn entry(family: Family, address: (u16, u8), row: &Row<'_>) -> Result<Entry, String> {
    let (index, sub) = address;
    let wrong = |what: &str| format!("object 0x{index:04X}:{sub:02X} is cut: `{what}`");
    let kind = kind(row.kind).ok_or_else(|| wrong(row.kind))?;
    let access = match row.access.to_lowercase().as_str() {
        "ro" | "const" => Access::Ro,
        "rw" | "rww" | "rwr" => Access::Rw,
        "wo" => Access::Wo,
        _ => return Err(wrong(row.access)),
    };
    let limit = |text: &str| match text {
        "" => Ok(None),
        text => number(text, kind).map(Some).ok_or_else(|| wrong(text)),
    };
    let known = objects::find(family.config(), index, sub);
    let usual = known.filter(|known| !known.varies).and_then(|known| known.range);
    let range = match (limit(row.low)?, limit(row.high)?) {
        (None, None) => usual,
        (low, high) => Some((low.unwrap_or(i64::MIN), high.unwrap_or(i64::MAX))),
    };
    let default = match kind {
        Kind::Text => 0,
        _ => limit(row.value)?.or(known.map(|known| known.default)).unwrap_or(0),
    };
    Ok(Entry {
        index,
        subindex: sub,
        kind,
        access,
        default,
        range,
        varies: false,
        live: false,
        families: &[],
        since: 0,
        name: known.map_or("", |known| known.name),
        key: "",
    })
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

/// A number as these files write it: decimal, hexadecimal, behind `$NODEID+`, and signed ones also
/// as their bits (0xFFFF for -1). What follows a semicolon is a comment.
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
    use std::fmt::Write as _;

    use super::*;

    /// The EDS of a drive with all objects of a family, in the form of maxon's tool.
    fn eds(family: Family) -> String {
        let objects: Vec<_> = objects::of_family(family.config()).collect();
        let mut text = "; maxon motor ag\n\n[FileInfo]\nEDSVersion=4.0\n\n[DeviceInfo]\n\
                        ProductNumber=0x60500000\nRevisionNumber=0x01100000\n"
            .to_owned();
        for (list, of_list) in [
            ("MandatoryObjects", 0x1000..=0x1001),
            ("OptionalObjects", 0x1002..=0x1FFF),
            ("ManufacturerObjects", 0x2000..=0xFFFF),
        ] {
            let mut indices: Vec<u16> = objects.iter().map(|object| object.index).collect();
            indices.retain(|index| of_list.contains(index));
            indices.dedup();
            let _ = writeln!(text, "\n[{list}]\nSupportedObjects={}", indices.len());
            for (at, index) in indices.iter().enumerate() {
                let _ = writeln!(text, "{}=0x{index:04X} ", at + 1);
            }
            for index in indices {
                let subs: Vec<_> = objects.iter().filter(|object| object.index == index).collect();
                let count = subs.len();
                if count > 1 || subs[0].subindex > 0 {
                    let _ = writeln!(text, "\n[{index:X}]\nSubNumber={count}\nObjectType=0x8");
                }
                for object in subs {
                    write_object(&mut text, object, count);
                }
            }
        }
        text
    }

    fn write_object(text: &mut String, object: &Entry, count: usize) {
        let Entry { index, subindex, default, .. } = object;
        let sub =
            if count > 1 || *subindex > 0 { format!("sub{subindex:X}") } else { String::new() };
        let kind = match object.kind {
            Kind::U8 => "5",
            Kind::U16 => "0x6",
            Kind::U32 => "0x0007",
            Kind::I8 => "0x2",
            Kind::I16 => "0x3",
            Kind::I32 => "0x4",
            Kind::U64 => "0x1B",
            Kind::Text => "0x9",
        };
        let access = match object.access {
            Access::Ro => "RO",
            Access::Rw => "rww",
            Access::Wo => "wo",
        };
        // Signed values as their bits.
        let bits = |value: i64| match object.kind.size() {
            1 => value & 0xFF,
            2 => value & 0xFFFF,
            _ => value & 0xFFFF_FFFF,
        };
        let _ = writeln!(text, "\n[{index:X}{sub}]\nParameterName=x\nDataType={kind}");
        let _ = writeln!(text, "AccessType={access}\nDefaultValue=0x{:X}  ; note", bits(*default));
        if let Some((low, high)) = object.range {
            let _ = writeln!(text, "LowLimit=0x{:X}\nHighLimit={}", bits(low), bits(high));
        }
    }

    #[test]
    fn an_eds_becomes_the_objects_of_the_drive() {
        for family in [Family::Epos4, Family::Epos2] {
            let file = DeviceFile::parse(&eds(family), "drive.eds").unwrap();
            assert_eq!(file.family, family);
            for (known, found) in objects::of_family(family.config()).zip(file.objects.iter()) {
                let of = |it: &Entry| (it.index, it.subindex, it.kind, it.access, it.range);
                assert_eq!(of(known), of(found));
                let is_set = known.kind != Kind::Text;
                assert!(!is_set || known.default == found.default, "{found:?}");
            }
        }
    }

    #[test]
    fn what_is_no_device_file_or_is_cut_is_one_clear_error() {
        let whole = eds(Family::Epos4);
        for at in (0..whole.trim_end().len() - 200).step_by(37) {
            let cut = DeviceFile::parse(&whole[..at], "drive.eds").unwrap_err();
            assert!(cut.contains("cut") && !cut.contains('\n'), "{at}: {cut}");
        }
        for (text, name, part) in [
            ("robot_id = \"x\"", "robot.toml", "it is no EDS: line 1"),
            ("\u{0}\u{1}\u{7f}ELF", "program", "it is no EDS: line 1"),
            (&format!("{CSV_HEAD}\n0x1000,0,U32,r"), "a.csv", "line 2 is cut"),
            (&format!("{CSV_HEAD}\n0x1000,0,U32,ro,,,,\n"), "a.csv", "object 0x1018:01 is absent"),
            (&format!("{CSV_HEAD}\n0x1000,0,U3,ro,,,,\n0x1018,1,U32,ro,,,,"), "a.csv", "absent"),
        ] {
            let error = DeviceFile::parse(text, name).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
    }
}
