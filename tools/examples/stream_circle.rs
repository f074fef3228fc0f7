//! Enables a robot that has been homed, and streams a circle of 2 deg once around its present pose.
//!
//! `stream_circle [DOMAIN]`
#![allow(clippy::print_stdout, reason = "an example")]

use std::error::Error;
use std::f64::consts::TAU;
use std::thread;
use std::time::Duration;

use i2ris::ipc::Domain;
use i2ris::ipc::client::Client;
use i2ris::robot::StateCommand;

const RADIUS_RAD: f64 = 0.035;
const PERIOD: Duration = Duration::from_millis(5);
/// 10 s for one turn: 1.3 deg/s.
const STEPS: u32 = 2000;

fn main() -> Result<(), Box<dyn Error>> {
    let domain = std::env::args().nth(1).unwrap_or_else(|| "i2ris".to_owned());
    let mut client = Client::connect(&Domain::new(&domain)?, Duration::from_secs(1))?;
    client.enable(Duration::from_secs(10))?;
    let start = loop {
        if let Some(joints) = client.measured_js()? {
            break joints.position;
        }
        thread::sleep(PERIOD);
    };
    let mut commander = client.commander();
    for step in 0..=STEPS {
        let (sine, cosine) = (TAU * f64::from(step) / f64::from(STEPS)).sin_cos();
        let goal = [start[0] + RADIUS_RAD * sine, start[1] + RADIUS_RAD * (1.0 - cosine)];
        commander.servo_jp(&goal)?;
        if let Some(joints) = client.measured_js()?.filter(|_| step % 200 == 0) {
            let [pitch, yaw, ..] = joints.position.map(f64::to_degrees);
            println!("pitch {pitch:.2} deg, yaw {yaw:.2} deg");
        }
        // The snake holds if no command arrives for 50 ms.
        thread::sleep(PERIOD);
    }
    client.state_command(StateCommand::Release)?;
    Ok(())
}
