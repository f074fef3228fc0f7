//! A scripted operator: sees the camera angles and the target of a task, and moves the stick of a
//! gamepad that is played through a pipe, for `i2ris teleop task reach --device PIPE`.
//!
//! The operator of the crossover model (McRuer and Jex, 1967): the deflection is the error one
//! reaction time ago, times a gain, with noise. Gain, reaction time and noise depend on the number
//! of the participant. The operator knows nothing of models and hysteresis.
//!
//! `operator PIPE PARTICIPANT [DOMAIN]`; `tools/manual/study.sh` uses it.
#![allow(clippy::print_stdout, reason = "an example for the command line")]

use std::fs::{File, OpenOptions};
use std::{collections::VecDeque, error::Error};

use i2ris::ipc::client::{Latest, Watcher};
use i2ris::ipc::payload::{ExternalPosition, ReachTarget, TeleopMsg};
use i2ris::{clock, ipc::Domain, units::Nanos};
use i2ris_teleop::recording::{write_frame, write_head};
use i2ris_teleop::{evdev_decoder::encode, state::Description};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

const KEY: u16 = 1;
const AXIS: u16 = 3;
const X: u16 = 0;
const Y: u16 = 1;
const DEAD_MAN: u16 = 0x137;
const FULL: f64 = 32767.0;
const FULL_SPEED_DEG_S: f64 = 10.0;
const PERIOD: Nanos = Nanos::from_millis(20);
const SEES_DEG: f64 = 0.06;

struct Hand {
    gain_per_s: f64,
    reaction: Nanos,
    /// Noise, relative to the deflection.
    noise: f64,
    random: Pcg64,
    seen: VecDeque<(Nanos, [f64; 2])>,
    answered: [f64; 2],
}

impl Hand {
    fn of(participant: u64) -> Self {
        let mut random = Pcg64::seed_from_u64(participant);
        Self {
            gain_per_s: random.random_range(1.2..2.0),
            reaction: Nanos::from_millis(random.random_range(180..280)),
            noise: random.random_range(0.05..0.15),
            random,
            seen: VecDeque::new(),
            answered: [0.0; 2],
        }
    }

    /// Deflections of pitch and yaw, each -1 to 1. `away`: to go, deg.
    fn push(&mut self, now: Nanos, away: [f64; 2]) -> [f64; 2] {
        self.seen.push_back((now, away));
        while let Some((at, away)) = self.seen.front()
            && now.duration_since(*at) >= self.reaction
        {
            self.answered = *away;
            self.seen.pop_front();
        }
        self.answered.map(|away| {
            let away = if away.abs() < SEES_DEG { 0.0 } else { away };
            let noise = 1.0 + self.noise * self.random.random_range(-1.0..1.0);
            (self.gain_per_s * away * noise / FULL_SPEED_DEG_S).clamp(-1.0, 1.0)
        })
    }
}

fn send(pipe: &mut File, kind: u16, code: u16, value: f64) -> std::io::Result<()> {
    let event = [encode(kind, code, value as i32), encode(0, 0, 0)].concat();
    write_frame(pipe, clock::now(), &event)
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [pipe, participant, domain @ ..] = &words[..] else {
        return Err("operator PIPE PARTICIPANT [DOMAIN]".into());
    };
    let domain = Domain::new(domain.first().map_or("i2ris", String::as_str))?;
    let mut hand = Hand::of(participant.parse()?);
    let watcher = Watcher::new(&domain);
    let (mut camera, mut target) =
        (Latest::new(watcher.external()), Latest::new(watcher.reach_target()));
    let mut published = Latest::new(watcher.teleop());
    // Waits for the reader.
    let mut pipe = OpenOptions::new().write(true).open(pipe)?;
    write_head(&mut pipe, &Description::gamepad("Scripted operator", ""))?;
    for (kind, code) in [(AXIS, X), (AXIS, Y), (KEY, DEAD_MAN)] {
        send(&mut pipe, kind, code, 0.0)?;
    }
    let started = clock::now();
    // The program must see all controls at rest before it accepts the dead-man.
    let follows = |it: &TeleopMsg| it.stamp_ns > started.0 && it.flags & TeleopMsg::OPEN == 0;
    while !published.refresh()?.is_some_and(follows) {
        for value in [0.0, 1.0] {
            send(&mut pipe, KEY, DEAD_MAN, value)?;
            clock::sleep(Nanos::from_millis(300));
        }
    }
    loop {
        clock::sleep(PERIOD);
        let now = clock::now();
        let (Some(camera), Some(target)) = (camera.refresh()?, target.refresh()?) else { continue };
        // Ignore a target of an earlier task.
        if target.shown_ns < started.0 {
            continue;
        }
        if target.flags & ReachTarget::ENDED != 0 && target.number == target.total {
            break;
        }
        if camera.flags & ExternalPosition::VALID == 0 {
            continue;
        }
        let to_go = [0, 1].map(|axis| (target.position[axis] - camera.position[axis]).to_degrees());
        let [pitch, yaw] = hand.push(now, to_go);
        send(&mut pipe, AXIS, X, FULL * yaw)?;
        // Away from the operator is up, and negative.
        send(&mut pipe, AXIS, Y, -FULL * pitch)?;
    }
    for code in [X, Y] {
        send(&mut pipe, AXIS, code, 0.0)?;
    }
    send(&mut pipe, KEY, DEAD_MAN, 0.0)?;
    println!("the task is over");
    Ok(())
}
