//! The connection to a controller.

use i2ris::ipc::Domain;
use i2ris::ipc::client::{Client, ClientError};
use i2ris::units::Nanos;

/// How long to wait for a controller that is just starting.
pub const CONNECT: Nanos = Nanos::from_millis(2000);

pub fn connect(domain: &Domain) -> Result<Client, ClientError> {
    Client::connect(domain, CONNECT)
}
