//! The cases of `cycle::goal_making`, checked on the setpoints that the drives receive.

use i2ris::config::CommandConfig;
use i2ris::model::ModelId;
use i2ris_testing::cycle::{GAIN_DEG, lag_counts};

use super::*;

/// A stream must begin at the snake, as shipped.
fn strict() -> Rig {
    let mut rig = Rig::with_model();
    rig.config.command.first_step_deg = CommandConfig::default().first_step_deg;
    rig.config.command.deadline_ms = 500;
    rig
}

/// Sends angles (degrees) one after the other, even if late.
fn send(commander: &mut Commander, angles: impl IntoIterator<Item = [f64; 2]>) {
    for angles in angles {
        commander.servo_jp(&angles.map(f64::to_radians)).unwrap();
        clock::sleep(SEND_PERIOD);
    }
}

/// Path of both motors between two instants, counts.
fn ways(rig: &Rig, from: Nanos, to: Nanos) -> [f64; 2] {
    [0, 1].map(|axis| {
        let setpoints: Vec<_> = rig.setpoints(axis);
        let pairs = setpoints.windows(2).filter(|pair| pair[0].0 > from && pair[1].0 < to);
        pairs.map(|pair| f64::from((pair[1].1 - pair[0].1).abs())).sum()
    })
}

#[test]
fn swap_at_zero_rate_moves_snake_only_by_blend() {
    type Zero = fn(&mut Commander) -> u64;
    let joint: Zero = |commander| commander.servo_jv(&[0.0; 2]).unwrap();
    let tip: Zero = |commander| commander.servo_cv([0.0; 3]).unwrap();
    for (gain, zero) in [(1.15, joint), (1.3, joint), (1.3, tip)] {
        let mut rig = strict();
        let other = rig.sample_model("other.json", "rig", gain);
        let mut client = rig.enabled();
        let other = ModelId(client.stage_model(&other).unwrap().slots[1].model_id);
        let [is_there, done] = [const { AtomicBool::new(false) }; 2];
        let mut commander = client.commander();
        let [begin, middle, end] = thread::scope(|scope| {
            scope.spawn(|| {
                send(&mut commander, (0..=400).map(|k| [0.02 * f64::from(k), 0.0]));
                while !done.load(Ordering::Relaxed) {
                    zero(&mut commander);
                    is_there.store(true, Ordering::Relaxed);
                    clock::sleep(SEND_PERIOD);
                }
            });
            let _end = SetOnDrop(&done);
            wait_until("8 deg", || is_there.load(Ordering::Relaxed));
            let begin = rig.wait_until_still();
            client.activate_model(other, true).unwrap();
            let middle = rig.wait_until_still();
            client.roll_back_model(true).unwrap();
            [begin, middle, rig.wait_until_still()]
        });
        let blend = 8.0 / (2.0 * GAIN_DEG) * (1.0 - 1.0 / gain);
        // Back across gap and friction.
        let turn = 2.0 * lag_counts().unwrap_or_default();
        for (from, to) in [(begin, middle), (middle, end)] {
            for way in ways(&rig, from, to) {
                assert!(
                    (0.8 * blend..1.1 * blend + 8.0 + turn).contains(&way),
                    "{gain}: {way} of {blend}"
                );
            }
        }
    }
}

#[test]
fn stream_returning_from_beyond_limit_has_followed_it() {
    let mut rig = strict();
    rig.config.joint_limits.position_max_deg = Some(vec![5.0, 9.5]);
    let client: Client = rig.enabled();
    // Out, 8 deg along outside, and back in by 0.4 deg: by 0.05 deg each.
    let steps =
        |count: u32, at: fn(f64) -> [f64; 2]| (0..count).map(move |k| at(0.05 * f64::from(k)));
    let out = steps(120, |way| [way, 0.0]);
    let along = steps(160, |way| [6.0, way]);
    let back = steps(28, |way| [6.0 - way, 8.0]).chain([[4.6, 8.0]; 100]);
    send(&mut client.commander(), out.chain(along).chain(back));
    rig.wait_until_still();
    let (a, b) = (rig.setpoints(0), rig.setpoints(1));
    let yaw = |(a, b): (&(Nanos, i32), &(Nanos, i32))| GAIN_DEG * f64::from(a.1 + b.1);
    let end = yaw((a.last().unwrap(), b.last().unwrap()));
    // Motor 0 has turned back, motor 1 has not.
    let lag = 2.0 * lag_counts().unwrap_or_default();
    let pitch = GAIN_DEG * (f64::from(a.last().unwrap().1 - b.last().unwrap().1) + lag);
    assert!((end - 8.0).abs() < 0.1 && (pitch - 4.6).abs() < 0.1, "{pitch} {end}");
}
