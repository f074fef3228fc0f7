//! The read-only page for a browser.
//!
//! The page cannot command anything by design, not by configuration. The server supports one
//! method, GET, and answers from a [`Dashboard`](crate::dashboard::Dashboard), which holds numbers;
//! it has no access to types of the client library. The thread that fills the dashboard subscribes
//! to streams and opens no publisher. It requests only the list of models, by a separate connection
//! that it closes again.
//!
//! A browser polls for new data ([`source`]), so a slow one gets less and a vanished one costs
//! nothing: the server keeps no state about browsers.

mod http;
mod listen_address;
mod route;
mod server;
mod snapshot;
mod source;

use std::net::TcpListener;
use std::sync::Arc;

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::units::Nanos;

pub use listen_address::{DEFAULT_ADDRESS, ListenAddress};
use source::Source;

use super::subscriptions::{READ_PERIOD, Subscriptions};
use i2ris_report::Failure;
use i2ris_report::model_poller::ModelPoller;
use i2ris_report::{Interrupt, Screen, until_closed};

/// Serves until a signal or the end of `span`. Needs no controller: the page reports if there is
/// none.
pub fn run(domain: &Domain, address: ListenAddress, span: Option<Nanos>) -> Result<(), Failure> {
    let interrupt = Interrupt::catch()?;
    let listener = TcpListener::bind(address.0).map_err(|error| {
        format!(
            "cannot serve at {}: {error}; is another monitor running there? choose a different \
             --web ADDRESS:PORT",
            address.0
        )
    })?;
    let address = listener.local_addr()?;
    if !address.ip().is_loopback() {
        eprintln!(
            "warning: {address} can be reached from other machines: everyone there can watch, \
             without a password and \
             without encryption. The page cannot command the robot."
        );
    }
    let source = Arc::new(Source::new(domain.name(), clock::now()));
    server::start(listener, Arc::clone(&source), address.ip().is_loopback())?;
    let outcome = Screen::stdout()
        .say(&format!("watch domain {} at http://{address}/ (read-only)", domain.name()));
    until_closed(outcome)?;
    let model_poller = ModelPoller::start(domain);
    let mut subscriptions = Subscriptions::new(domain);
    let start = clock::now();
    while !interrupt.came() && span.is_none_or(|span| clock::now().duration_since(start) < span) {
        let now = clock::now();
        let mut dashboard = source.dashboard();
        if subscriptions.refresh(&mut dashboard, now) {
            model_poller.poll_now();
        }
        dashboard.models = model_poller.known();
        drop(dashboard);
        clock::sleep(READ_PERIOD);
    }
    Ok(())
}
