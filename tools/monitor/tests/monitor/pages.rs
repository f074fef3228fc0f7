//! Content of both pages in a browser: reasons, faults, numbers, and the sound at limits.

use i2ris::ipc::payload::{VirtualFixturesMsg, padded_text};
use i2ris::ipc::{Fault, FixtureKind, OperatingState, Refusal};
use i2ris::robot::{Cause, Clip, Measurement, Quantity, Reason};
use serde_json::json;

use i2ris_needs::needs;
use i2ris_testing::{Background, Controller, Rig, stream_angles, swing_angles_until};
use nix::sys::signal::Signal;

use crate::http::Served;

const PITCH: &str = "document.querySelectorAll('#joints td.estimate')[0].textContent";
pub const WHY: &str = "document.getElementById('why')?.innerText";

fn reason(cause: Cause, measurement: Measurement) -> Reason {
    Reason { cause, measurement: Some(measurement) }
}

#[needs("program: chromium or chromium-browser or google-chrome or google-chrome-stable")]
#[test]
fn both_pages_show_why_the_robot_does_not_follow() {
    let controller = Controller::enabled();
    let served = Served::start(&controller.domain);
    let mut pages = ["", "operator"].map(|page| served.open(page, [1280, 800]));
    for page in &mut pages {
        let present = format!("{WHY}?.startsWith('refusal 7: no model is loaded; action: ')");
        page.wait("the present reason", &present);
    }
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
    for page in &mut pages {
        page.wait("the fault", &expected);
    }
    let [page, operator] = &mut pages;
    // Noise does not displace the fault.
    for number in 0..60 {
        let noise = Measurement::new(Quantity::Degrees, f64::from(number), Some(2.0));
        let noise = reason(Cause::Refusal(Refusal::StepTooLarge), noise);
        controller.robot().reasons.push((noise, 7));
    }
    page.wait(
        "the fault in its own list",
        "document.getElementById('alarms').innerText.includes('fault 3: ')",
    );
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
    page.wait(
        "the fixture",
        "typeof live === 'object' && live?.fixtures.length === 1 && live.estimate?.deg != null",
    );
    page.evaluate("window.beeps = []; window.beep = (hz, span) => beeps.push([hz, span])");
    // The circle ends 5.73 deg from the middle.
    let at = |controller: &Controller, yaw_deg: f64| controller.robot().pose = [0.0, yaw_deg];
    at(&controller, 4.0);
    page.wait(
        "1.7 deg away",
        "live.cue?.kind === 'fixture' && Math.abs(live.cue.deg - 1.73) < 0.02",
    );
    assert_eq!(page.evaluate("[beeps.length, audio === null]"), json!([0, true]), "off");
    page.press("s");
    page.wait("a beat", "beeps.length > 1 && beeps[0][0] === 880 && beeps[0][1] < 0.1");
    page.wait("words", "document.getElementById('cue').textContent === '1.7° to a fixture'");
    at(&controller, 5.7);
    page.wait("one tone", "beeps.at(-1)[1] > 0.1");
    at(&controller, 0.0);
    page.wait("silence far away", "document.getElementById('cue').textContent === ''");
    at(&controller, 4.0);
    page.wait("a beat again", "document.getElementById('cue').textContent !== ''");
    page.press("s");
    page.wait("off", "audio === null && document.getElementById('cue').textContent === ''");
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
    page.wait(
        "a camera",
        "/[0-9]/.test(document.querySelector('#joints td.camera, #joints td.parted').textContent)",
    );
    page.wait("the hull", "live.hull.length > 20");
    page.wait("frames with counts", "recent.frames.some((row) => row[3] !== null)");
    page.wait(
        "rates",
        "/^[1-9]/.test(document.querySelectorAll('#motors tr')[1].children[4].textContent)",
    );
    // Every plot has something in every colour that belongs there: it is drawn, not only laid out.
    let drawn = "[...document.querySelectorAll('canvas')].every((c) => new Set(new Uint32Array(\
                 c.getContext('2d').getImageData(0, 0, c.width, c.height).data.buffer)).size > 50)";
    page.wait("curves on every canvas", drawn);
    page.wait(
        "everything on one screen",
        "document.documentElement.scrollHeight <= window.innerHeight",
    );

    robot.signal(Signal::SIGSTOP);
    page.wait(
        "staleness",
        "document.getElementById('badge').textContent.startsWith('STALE, was ')",
    );
    page.wait(
        "a banner",
        "document.getElementById('banner').textContent.startsWith('STALE: the controller')",
    );
    page.wait("a mark", "document.body.innerText.includes('estimate STALE')");
    robot.signal(Signal::SIGCONT);
    page.wait("fresh again", "!document.getElementById('badge').textContent.startsWith('STALE')");
    drop(commander);
    robot.signal(Signal::SIGTERM);
    page.wait(
        "absence",
        "document.getElementById('banner').textContent.includes('no controller serves domain')",
    );

    let refused = page.evaluate(
        "fetch('/live', { method: 'POST', body: 'enable' }).then((answer) => answer.status)",
    );
    assert_eq!(refused, json!(405));
    // The browser itself reports the refusal that was just requested, and of nothing else.
    let complaints: Vec<_> =
        page.complaints().into_iter().filter(|text| !text.contains("405")).collect();
    assert!(complaints.is_empty(), "{complaints:#?}");
    let strange: Vec<_> =
        page.requested().into_iter().filter(|address| !address.starts_with(&url)).collect();
    assert!(strange.is_empty(), "{strange:?}");
    assert!(page.requested().len() > 10);

    served.program.interrupt();
    page.wait(
        "silence",
        "document.getElementById('banner').textContent.startsWith('THE MONITOR DOES NOT ANSWER')",
    );
}
