//! Identity of a device: unchanged after unplugging, independent of the kernel's number.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// Vendor and product, such as `046d:c62b`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ProductId {
    pub vendor: u16,
    pub product: u16,
}

impl fmt::Display for ProductId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04x}:{:04x}", self.vendor, self.product)
    }
}

impl FromStr for ProductId {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let hex = |part: &str| u16::from_str_radix(part, 16).ok().filter(|_| part.len() == 4);
        let id = text.split_once(':').and_then(|(vendor, product)| {
            Some(Self { vendor: hex(vendor)?, product: hex(product)? })
        });
        id.ok_or_else(|| format!("`{text}` is not vendor:product in hexadecimal, e.g. 046d:c62b"))
    }
}

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

    pub fn product_id(&self) -> ProductId {
        ProductId { vendor: self.vendor, product: self.product }
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
        let id = ProductId { vendor: 0x046d, product: 0xc62b };
        assert_eq!((id.to_string().as_str(), "046d:c62b".parse()), ("046d:c62b", Ok(id)));
        for wrong in ["", "046d", "46d:c62b", "046d:c62b1", "zzzz:0000"] {
            assert!(wrong.parse::<ProductId>().is_err(), "{wrong}");
        }
    }
}
