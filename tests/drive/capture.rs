//! Captures of disturbed lines: a replay gives the same received bytes.

use i2ris::drive::capture::{CapturedLine, CapturedPort};
use i2ris::drive::{AxisRequest, Demand, Port};
use i2ris::units::{Counts, Nanos};
use i2ris_testing::drive::{Disturbance, one_drive, open, replayed};

/// A drive that follows setpoints on a disturbed line.
fn disturbed(seed: u64) -> CapturedPort {
    let (line, config, _) = open(vec![one_drive()]);
    let (captured, capture) = CapturedLine::new(line.clone(), &config);
    let (mut runner, mut links) = Port::over(captured, &config).bring_up().unwrap().split();
    let mut request = AxisRequest { demand: Demand::Enabled, ..AxisRequest::default() };
    let mut random = seed;
    for turn in 0..500 {
        request.sequence += 1;
        request.target = Counts(turn % 1000);
        links[0].requests.write(request);
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let at = (random >> 40) as usize;
        let disturbances = [
            Disturbance::LoseReply,
            Disturbance::FlipRequest(at),
            Disturbance::TruncateRequest(at),
            Disturbance::FlipReply(at),
            Disturbance::DropReplyByte(at),
            Disturbance::DuplicateReplyByte(at),
            Disturbance::TruncateReply(at),
            Disturbance::DelayReply(Nanos::from_millis(at as u64 % 40)),
            Disturbance::Noise,
            Disturbance::StrayReply,
        ];
        line.disturb(disturbances.get(at % 30).copied());
        if at.is_multiple_of(400) {
            line.state().hung_up = true;
            let again = line.clone();
            let repair = move || again.state().hung_up = false;
            line.plan(line.time() + Nanos::from_millis(30), repair);
        }
        runner.turn(&mut |_| {});
    }
    capture.read()
}

/// I2RIS_FRAMES sets the number of frames.
#[test]
fn capture_of_disturbed_line_replays_without_difference() {
    let least: u64 = std::env::var("I2RIS_FRAMES").map_or(1_000_000, |text| text.parse().unwrap());
    let (mut frames, mut failures, mut seed) = (0, 0, 0);
    while frames < least {
        let (more, failed) = replayed(&disturbed(seed));
        (frames, failures, seed) = (frames + more, failures + failed, seed + 1);
    }
    println!("{frames} frames of {seed} lines replayed, {failures} attempts failed: 0 differences");
    assert!(failures > 100);
}
