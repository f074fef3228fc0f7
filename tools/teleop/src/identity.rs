//! Identity of a device: unchanged after unplugging, independent of the kernel's number.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Identity that a device reports.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    pub vendor: u16,
    pub product: u16,
    pub name: String,
    /// The serial number, or the address of a wireless device; empty if it reports none.
    pub serial: String,
}

impl Identity {
    /// Identity of a device without a serial number.
    pub fn new(vendor: u16, product: u16, name: &str) -> Self {
        Self { vendor, product, name: name.to_owned(), serial: String::new() }
    }

    /// Vendor and product, such as `046d:c62b`.
    pub fn product_id(&self) -> String {
        format!("{:04x}:{:04x}", self.vendor, self.product)
    }
}

/// Fails if a text has not the form of [`Identity::product_id`].
pub(crate) fn check_product_id(text: &str) -> Result<(), String> {
    let is_hex = |part: &str| part.len() == 4 && u16::from_str_radix(part, 16).is_ok();
    match text.split_once(':') {
        Some((vendor, product)) if is_hex(vendor) && is_hex(product) => Ok(()),
        _ => Err(format!("`{text}` is not vendor:product in hexadecimal, e.g. 046d:c62b")),
    }
}

impl fmt::Display for Identity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.name, self.product_id())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_product_id_is_read_as_it_is_written() {
        let id = Identity::new(0x046d, 0xc62b, "x").product_id();
        assert_eq!((id.as_str(), check_product_id(&id)), ("046d:c62b", Ok(())));
        for wrong in ["", "046d", "46d:c62b", "046d:c62b1", "zzzz:0000"] {
            assert!(check_product_id(wrong).is_err(), "{wrong}");
        }
    }
}
