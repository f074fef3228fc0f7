//! `i2ris stop`: holds every client and ends every activity immediately.

use std::thread;

use i2ris::ipc::ready::{served_by_others, served_domains};
use i2ris::{ipc::Domain, ipc::client::Client, units::Nanos};
use i2ris_report::exit::{self, Coded, NOT_CONFIRMED};
use i2ris_report::{Failure, stop::Stopped, stop::stop};

use crate::procedure::say;

/// A running controller connects immediately.
const CONNECT: Nanos = Nanos::from_millis(500);

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Holds every client, ends a move, conditioning and homing, and waits until \
nothing moves. Prints what it stopped and the resulting state. The drives stay on: `i2ris \
disable` switches them off. It does not replace a switch that cuts the power.

Without --domain and I2RIS_DOMAIN it stops every robot of this user: nothing to choose.
For robots of other users, visible to root, it prints the command that stops them."
)]
pub struct Arguments {
    /// Stop the robot of this domain only
    #[arg(long, env = "I2RIS_DOMAIN", value_name = "NAME")]
    domain: Option<String>,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let domains = arguments.domain.clone().map_or_else(served_domains, |name| vec![name]);
    if domains.is_empty() {
        let others: String = others(&served_by_others()).map(|line| line + "; ").collect();
        let sentence = format!(
            "no controller of this user runs: nothing was stopped; {others}if anything moves, cut \
             the power"
        );
        return Err(Coded { code: 3, sentence }.into());
    }
    // In parallel: a hung controller does not delay the others.
    let stops: Vec<_> =
        domains.into_iter().map(|name| thread::spawn(move || (stop_one(&name), name))).collect();
    let (is_one, mut worst) = (stops.len() == 1, None::<Coded>);
    for (outcome, name) in stops.into_iter().filter_map(|stop| stop.join().ok()) {
        let text = outcome.as_ref().map_or_else(ToString::to_string, Clone::clone);
        let line = format!("domain {name}: {text}");
        if outcome.is_ok() || !is_one {
            say(&line)?;
        }
        if let Err(coded) = outcome {
            let coded = Coded { sentence: line, ..coded };
            worst = worst.filter(|it| it.code >= coded.code).or(Some(coded));
        }
    }
    // Robots that can be stopped come first.
    for line in others(&served_by_others()).filter(|_| arguments.domain.is_none()) {
        say(&line)?;
    }
    worst.map_or(Ok(()), |worst| Err(worst.into()))
}

fn others(served: &[(u32, String)]) -> impl Iterator<Item = String> {
    served.iter().map(|(user, domain)| {
        format!(
            "domain {domain} of user {user} was NOT stopped: `sudo -u '#{user}' i2ris stop \
             --domain {domain}`"
        )
    })
}

/// The text; an error that says what to do, unless the robot is confirmed to be at rest.
pub fn confirmed(Stopped { text, is_known }: Stopped) -> Result<String, Coded> {
    let sentence = format!("{text}; cut the power if in doubt");
    if is_known { Ok(text) } else { Err(Coded { code: NOT_CONFIRMED, sentence }) }
}

fn stop_one(name: &str) -> Result<String, Coded> {
    let stopped = || -> Result<_, Failure> {
        let domain = Domain::new(name)?;
        Ok(stop(&mut Client::connect(&domain, CONNECT)?, &domain)?)
    };
    match stopped() {
        Ok(stopped) => confirmed(stopped),
        Err(failure) => {
            let text = format!("NOT CONFIRMED to be stopped: {failure}; cut the power if in doubt");
            Err(Coded { code: exit::code(&failure), sentence: text })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stop_command_for_another_users_robot_is_named() {
        let lines: Vec<String> = others(&[(1001, "eye".to_owned())]).collect();
        let command = "`sudo -u '#1001' i2ris stop --domain eye`";
        assert_eq!(lines, [format!("domain eye of user 1001 was NOT stopped: {command}")]);
    }
}
