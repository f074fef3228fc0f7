//! Both pages in a browser: reasons, faults, numbers, the sound at limits, the trial.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use i2ris::clock;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::{TrialMsg, VirtualFixturesMsg, padded_text};
use i2ris::ipc::{Fault, FixtureKind, OperatingState, Refusal};
use i2ris::robot::{Cause, Clip, Measurement, Quantity, Reason};
use i2ris::units::Nanos;
use i2ris_needs::needs;
use i2ris_testing::bench::{assert_says, succeeds};
use i2ris_testing::{Background, Controller, Rig, TIMEOUT, stream_angles, swing_angles_until};
use nix::sys::signal::Signal;
use serde_json::json;

use crate::http::Served;

const PITCH: &str = "document.querySelectorAll('#joints td.estimate')[0].textContent";
const BADGE: &str = "document.getElementById('badge').textContent";
const BANNER: &str = "document.getElementById('banner').textContent";
const CUE: &str = "document.getElementById('cue').textContent";
const WHY: &str = "document.getElementById('why')?.innerText";

fn reason(cause: Cause, measurement: Measurement) -> Reason {
    Reason { cause, measurement: Some(measurement) }
}

#[needs("program: chromium or chromium-browser or google-chrome or google-chrome-stable")]
#[test]
fn both_pages_show_why_the_robot_does_not_follow() {
    let controller = Controller::enabled();
    let served = Served::start(&controller.domain);
    let mut pages = ["", "operator"].map(|page| served.open(page, [1280, 800]));
    let present = format!("{WHY}?.startsWith('refusal 7: no model is loaded; action: ')");
    pages.iter_mut().for_each(|page| page.wait("the present reason", &present));
    let step = Measurement::new(Quantity::Degrees, 9.25, Some(2.0));
    let clip = Measurement::new(Quantity::Degrees, 1.5, None);
    for reason in [
        reason(Cause::Refusal(Refusal::StepTooLarge), step),
        reason(Cause::Clip(Clip::Reach), clip),
    ] {
        let expected = format!("{WHY} === {}", json!(reason.to_string()));
        for page in &mut pages {
            // News for a few seconds only: sent again for every page.
            controller.robot().reasons.push((reason, 7));
            page.wait("a refusal or a clip", &expected);
        }
    }
    let fault = Measurement::new(Quantity::Counts, 2314.0, Some(2000.0)).of_motor(1);
    let fault = reason(Cause::Fault(Fault::FollowingError), fault);
    {
        let mut robot = controller.robot();
        (robot.state, robot.fault) = (OperatingState::Fault, Fault::FollowingError);
        robot.reasons.push((fault, 0));
    }
    let expected = format!("{WHY} === {}", json!(fault.to_string()));
    pages.iter_mut().for_each(|page| page.wait("the fault", &expected));
    let [page, operator] = &mut pages;
    // Noise does not displace the fault.
    for number in 0..60 {
        let noise = Measurement::new(Quantity::Degrees, f64::from(number), Some(2.0));
        let noise = reason(Cause::Refusal(Refusal::StepTooLarge), noise);
        controller.robot().reasons.push((noise, 7));
    }
    let listed = "document.getElementById('alarms').innerText.includes('fault 3: ')";
    page.wait("the fault in its own list", listed);
    page.wait("one line of noise", "document.querySelectorAll('#events .warning').length <= 3");
    operator.wait("the state", "document.getElementById('badge').textContent === 'FAULT'");
}

#[needs("program: chromium or chromium-browser or google-chrome or google-chrome-stable")]
#[test]
fn sound_at_limits_is_optional_and_faster_when_closer() {
    let controller = Controller::enabled();
    let mut fixtures = VirtualFixturesMsg { active: 1, ..VirtualFixturesMsg::default() };
    fixtures.kind[0] = FixtureKind::Circle.number();
    fixtures.values[0][..3].copy_from_slice(&[0.0, 0.2, 0.1]);
    fixtures.name[0] = padded_text("lens");
    controller.robot().fixtures = Some(fixtures);
    let served = Served::start(&controller.domain);
    let mut page = served.open("operator", [1280, 800]);
    let present =
        "typeof live === 'object' && live?.fixtures.length === 1 && live.estimate?.deg != null";
    page.wait("the fixture", present);
    page.evaluate("window.beeps = []; window.beep = (hz, span) => beeps.push([hz, span])");
    // The circle ends 5.73 deg from the middle.
    let at = |controller: &Controller, yaw_deg: f64| controller.robot().pose = [0.0, yaw_deg];
    at(&controller, 4.0);
    let away = "live.cue?.kind === 'fixture' && Math.abs(live.cue.deg - 1.73) < 0.02";
    page.wait("1.7 deg away", away);
    assert_eq!(page.evaluate("[beeps.length, audio === null]"), json!([0, true]), "off");
    page.press("s");
    page.wait("a beat", "beeps.length > 1 && beeps[0][0] === 880 && beeps[0][1] < 0.1");
    page.wait("words", &format!("{CUE} === '1.7° to a fixture'"));
    at(&controller, 5.7);
    page.wait("one tone", "beeps.at(-1)[1] > 0.1");
    at(&controller, 0.0);
    page.wait("silence far away", &format!("{CUE} === ''"));
    at(&controller, 4.0);
    page.wait("a beat again", &format!("{CUE} !== ''"));
    page.press("s");
    page.wait("off", &format!("audio === null && {CUE} === ''"));
    assert!(page.complaints().is_empty(), "{:?}", page.complaints());
}

#[needs("program: chromium or chromium-browser or google-chrome or google-chrome-stable")]
#[test]
fn browser_shows_live_numbers_and_marks_stale_ones() {
    let mut robot = Rig::with_model();
    let client = robot.enabled();
    let commander = Background::start(move |stop| stream_angles(&client, swing_angles_until(stop)));
    let mut served = Served::start(&robot.domain());
    let url = format!("http://{}/", served.address);
    let mut page = served.open("", [1920, 1080]);
    page.wait("the state", "document.getElementById('badge')?.textContent === 'ENABLED'");
    page.wait("motion", &format!("window.first ??= {PITCH}, window.first !== {PITCH}"));
    let camera = "document.querySelector('#joints td.camera, #joints td.parted').textContent";
    page.wait("a camera", &format!("/[0-9]/.test({camera})"));
    page.wait("the hull", "live.hull.length > 20");
    page.wait("frames with counts", "recent.frames.some((row) => row[3] !== null)");
    let rate = "document.querySelectorAll('#motors tr')[1].children[4].textContent";
    page.wait("rates", &format!("/^[1-9]/.test({rate})"));
    // Every plot has something in every colour that belongs there: it is drawn, not only laid out.
    let drawn = "[...document.querySelectorAll('canvas')].every((c) => new Set(new Uint32Array(\
                 c.getContext('2d').getImageData(0, 0, c.width, c.height).data.buffer)).size > 50)";
    page.wait("curves on every canvas", drawn);
    let fits = "document.documentElement.scrollHeight <= window.innerHeight";
    page.wait("everything on one screen", fits);

    robot.signal(Signal::SIGSTOP);
    page.wait("staleness", &format!("{BADGE}.startsWith('STALE, was ')"));
    page.wait("a banner", &format!("{BANNER}.startsWith('STALE: the controller')"));
    page.wait("a mark", "document.body.innerText.includes('estimate STALE')");
    robot.signal(Signal::SIGCONT);
    page.wait("fresh again", &format!("!{BADGE}.startsWith('STALE')"));
    drop(commander);
    robot.signal(Signal::SIGTERM);
    page.wait("absence", &format!("{BANNER}.includes('no controller serves domain')"));

    let post = "fetch('/live', { method: 'POST', body: 'enable' }).then((answer) => answer.status)";
    assert_eq!(page.evaluate(post), json!(405));
    // The browser itself reports the refusal that was just requested, and of nothing else.
    let complaints: Vec<_> =
        page.complaints().into_iter().filter(|text| !text.contains("405")).collect();
    assert!(complaints.is_empty(), "{complaints:#?}");
    let strange: Vec<_> =
        page.requested().into_iter().filter(|address| !address.starts_with(&url)).collect();
    assert!(strange.is_empty(), "{strange:?}");
    assert!(page.requested().len() > 10);

    served.program.interrupt();
    page.wait("silence", &format!("{BANNER}.startsWith('THE MONITOR DOES NOT ANSWER')"));
}

/// Runs a test while a trial is recorded, whose flags are the test's.
fn while_recorded(test: impl FnOnce(&Controller, &AtomicU32)) {
    let controller = Controller::enabled();
    let client = Client::connect(&controller.domain, TIMEOUT).unwrap();
    let mut recorder = client.announcer::<TrialMsg>();
    let flags = Arc::new(AtomicU32::new(0));
    let (published, begun) = (Arc::clone(&flags), clock::now());
    let publishing = Background::start(move |stop| {
        while !stop.load(Ordering::Relaxed) {
            let trial = TrialMsg {
                started_ns: begun.0,
                mark_ns: begun.0,
                mark_number: 2,
                trial: padded_text("P07-joystick-02"),
                mark: padded_text("contact"),
                flags: published.load(Ordering::Relaxed),
                ..TrialMsg::default()
            };
            recorder.publish(trial).unwrap();
            clock::sleep(Nanos::from_millis(100));
        }
    });
    test(&controller, &flags);
    drop(publishing);
}

#[test]
fn status_shows_the_trial_and_its_newest_mark() {
    while_recorded(|controller, _| {
        let parts = ["study      trial P07-joystick-02 for ", ", mark 2: contact"];
        assert_says(&succeeds(&controller.domain, "status"), &parts);
    });
}

#[needs("program: chromium or chromium-browser or google-chrome or google-chrome-stable")]
#[test]
fn both_pages_show_trial_newest_mark_and_failed_recording() {
    while_recorded(both_pages_show_the_trial);
}

fn both_pages_show_the_trial(controller: &Controller, flags: &AtomicU32) {
    let served = Served::start(&controller.domain);
    let mut pages = ["", "operator"].map(|page| served.open(page, [1280, 800]));
    let shown = "document.getElementById('flags')?.innerText";
    for page in &mut pages {
        page.wait("the trial", &format!("{shown}.includes('trial P07-joystick-02, ')"));
        page.wait("its mark", &format!("{shown}.includes('mark 2: contact, ')"));
    }
    flags.store(TrialMsg::FAILED, Ordering::Relaxed);
    for page in &mut pages {
        page.wait("a recording that failed", &format!("{shown}.includes('NOT RECORDED')"));
        page.wait("what to do", &format!("{WHY}.includes('free disk space')"));
    }
}
