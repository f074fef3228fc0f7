//! The option `--domain`.

use i2ris::ipc::{Domain, DomainError};

/// `--domain`.
#[derive(Debug, clap::Args)]
pub struct DomainOption {
    /// Domain of the controller in shared memory
    #[arg(long, env = "I2RIS_DOMAIN", default_value = "i2ris", value_name = "NAME", global = true)]
    domain: String,
}

impl DomainOption {
    /// The domain.
    pub fn domain(&self) -> Result<Domain, DomainError> {
        Domain::new(&self.domain)
    }
}
