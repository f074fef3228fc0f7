//! What both pages say at the moment, in a browser: reasons, commander, faults; every width, both
//! themes, and the keyboard.

use i2ris::clock;
use i2ris::ipc::client::{Client, ExternalPublisher};
use i2ris::ipc::payload::{TeleopMsg, VirtualFixturesMsg, padded_text};
use i2ris::ipc::{Fault, FixtureKind, OperatingState, Refusal};
use i2ris::robot::{Cause, Clip, Measurement, Quantity, Reason};
use i2ris::units::Nanos;
use serde_json::json;

use i2ris_testing::{Background, Controller, Rig, TIMEOUT, stream_angles, swing_angles_until};
use nix::sys::signal::Signal;

use crate::chromium::Browser;
use crate::http::Served;

const PITCH: &str = "document.querySelectorAll('#joints td.estimate')[0].textContent";
pub const WHY: &str = "document.getElementById('why')?.innerText";

/// Does it again and again until it is true, or too late.
fn within_timeout(mut is_true: impl FnMut() -> bool) -> bool {
    let start = clock::now();
    while clock::now().duration_since(start) < TIMEOUT {
        if is_true() {
            return true;
        }
        clock::sleep(Nanos::from_millis(20));
    }
    false
}

fn reason(cause: Cause, measurement: Measurement) -> Reason {
    Reason { cause, measurement: Some(measurement) }
}

#[test]
fn both_pages_say_at_once_why_the_robot_does_not_follow() {
    let controller = Controller::enabled();
    let served = Served::start(&controller.domain);
    let pages = ["", "operator"].map(|page| served.open(page, [1280, 800]));
    let [Some(page), Some(operator)] = pages else { return };
    let mut pages = [page, operator];
    for page in &mut pages {
        let present = format!("{WHY}?.startsWith('refusal 7: no model is loaded; do: ')");
        page.wait("what keeps it now", &present);
    }
    let step = Measurement::new(Quantity::Degrees, 9.25, Some(2.0));
    let clip = Measurement::new(Quantity::Degrees, 1.5, None);
    for reason in
        [reason(Cause::Refusal(Refusal::Step), step), reason(Cause::Clip(Clip::Reach), clip)]
    {
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
        let noise = reason(Cause::Refusal(Refusal::Step), noise);
        controller.robot().reasons.push((noise, 7));
    }
    page.wait(
        "the fault in its own list",
        "document.getElementById('alarms').innerText.includes('fault 3: ')",
    );
    page.wait("one line of noise", "document.querySelectorAll('#events .warning').length <= 3");
    operator.wait("the state", "document.getElementById('badge').textContent === 'FAULT'");
}

#[test]
fn the_commander_has_a_name_and_a_camera_that_parts_is_alarmed() {
    let controller = Controller::enabled();
    let served = Served::start(&controller.domain);
    let client = Client::connect(&controller.domain, Nanos::from_millis(20_000)).unwrap();
    let mut commander = client.commander();
    let mut camera = ExternalPublisher::new(&controller.domain);
    let Some(mut page) = served.open("", [1280, 800]) else { return };
    page.wait("the page", "document.getElementById('lease') !== null");
    let name = std::env::current_exe().unwrap();
    let name: String = { name.file_name().unwrap().to_str().unwrap() }.chars().take(10).collect();
    let named = json!(format!("commander: {name}"));
    let (pid, mut is_named, mut is_parted) = (std::process::id(), false, false);
    for _ in 0..600 {
        commander.servo_jp(&[0.02, -0.02]).unwrap();
        let now = clock::now();
        camera.publish(now, &[0.1, -0.02], &[]).unwrap();
        let lease = "document.getElementById('lease').textContent";
        let is_true = |script: String, page: &mut Browser| page.evaluate(&script) == json!(true);
        is_named |= is_true(
            format!("{lease}.startsWith({named}) && {lease}.includes('process {pid}')"),
            &mut page,
        );
        is_parted |= is_true(
            "document.body.innerText.includes('CAMERA AND ESTIMATE PART BY 4.6 deg') && \
             document.querySelectorAll('#joints td.error')[0].textContent === '−4.58'"
                .to_owned(),
            &mut page,
        );
        if is_named && is_parted {
            break;
        }
    }
    let text = page.evaluate("document.body.innerText");
    assert!(is_named && is_parted, "named {is_named}, parted {is_parted}: {text}");
}

#[test]
fn the_operator_reads_from_afar_what_is_wrong_and_how_large_the_error_is() {
    let controller = Controller::enabled();
    controller.robot().pose = [-28.65, 3.0];
    let served = Served::start(&controller.domain);
    let mut camera = ExternalPublisher::new(&controller.domain);
    let Some(mut page) = served.open("operator?limit=0.4", [1920, 1080]) else { return };
    page.wait("no camera yet", "document.getElementById('flags')?.innerText.includes('no camera')");
    page.wait("watchdog", "document.getElementById('flags').innerText.includes('NO WATCHDOG')");
    let size = "parseFloat(getComputedStyle(document.getElementById('pitch')).fontSize)";
    assert!(page.evaluate(size).as_f64().unwrap() >= 2.0 * 130.0, "{}", page.evaluate(size));
    for ((pitch, level), width) in
        [(-28.7_f64, "near"), (-29.2, "off"), (-30.0, "far")].into_iter().zip([1920, 1280, 360])
    {
        page.resize([width, width * 9 / 16 + 400]);
        let is_shown =
            format!("document.getElementById('error-tile').classList.contains('{level}')");
        let shown = within_timeout(|| {
            let angles = [pitch.to_radians(), 3.0_f64.to_radians()];
            camera.publish(clock::now(), &angles, &[]).unwrap();
            page.evaluate(&is_shown) == json!(true)
                || (level == "far"
                    && page.evaluate(
                        "document.getElementById('error-tile').classList.contains('parted')",
                    ) == json!(true))
        });
        assert!(shown, "{level}: {}", page.evaluate("document.body.innerText"));
        let too_wide = "[...document.querySelectorAll('.angle')]
            .filter((tile) => tile.scrollWidth > tile.clientWidth + 1).length";
        assert_eq!(page.evaluate(too_wide), json!(0), "at {width}");
        pictures_of(&mut page, &format!("operator-{level}"));
    }
    page.wait("silence", "document.getElementById('flags').innerText.includes('CAMERA SILENT')");
    let client = Client::connect(&controller.domain, TIMEOUT).unwrap();
    let mut hand = client.announcer::<TeleopMsg>();
    let has = |text: &str| format!("document.getElementById('flags').innerText.includes('{text}')");
    for (flags, text) in [(TeleopMsg::OPEN, "CLUTCH OPEN: never centred"), (0, "FOLLOWS AT 50 %")] {
        let shown = within_timeout(|| {
            let (view, scale) = ([[-1.0, 0.0], [0.0, 1.0]], 0.5);
            let why_open = padded_text("never centred");
            let message = TeleopMsg { flags, view, scale, why_open, ..TeleopMsg::default() };
            hand.publish(message).unwrap();
            page.evaluate(&has(text)) == json!(true)
                && page.evaluate(&has("+pitch ←, +yaw ↑")) == json!(true)
        });
        assert!(shown, "{text}: {}", page.evaluate("document.body.innerText"));
    }
    pictures_of(&mut page, "operator-hand");
    pictures_of(&mut page, "operator-silent");
}

#[test]
fn limits_sound_faster_as_they_come_nearer_and_only_when_somebody_requested() {
    let controller = Controller::enabled();
    let mut fixtures = VirtualFixturesMsg { active: 1, ..VirtualFixturesMsg::default() };
    fixtures.kind[0] = FixtureKind::Circle.number();
    fixtures.values[0][..3].copy_from_slice(&[0.0, 0.2, 0.1]);
    fixtures.name[0] = padded_text("lens");
    controller.robot().fixtures = Some(fixtures);
    let served = Served::start(&controller.domain);
    let Some(mut page) = served.open("operator", [1280, 800]) else { return };
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
    pictures_of(&mut page, "operator-sound");
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

#[test]
fn a_scale_has_two_ticks_an_error_its_reason_and_an_old_fault_leaves_the_list() {
    let controller = Controller::enabled();
    let served = Served::start(&controller.domain);
    let Some(mut page) = served.open("", [1280, 800]) else { return };
    page.wait(
        "the page",
        "typeof ticks === 'function' && typeof live === 'object' && live !== null",
    );
    let few = "[[-0.9, 0.9, 1], [-3, 1.2, 1], [0.1, 9, 2], [-20, 0, 2]]
        .map(([low, high, wanted]) => ticks([low, high], wanted).length).filter((count) => count < 2).length";
    assert_eq!(page.evaluate(few), json!(0), "one tick is no scale");
    let notes = "(() => { const said = [];
        const plot = { begin: () => true, scales() {}, grid() {}, curve() {}, end() {}, say() {},
            pen: { setLineDash() {} }, note: (text) => said.push(text) };
        drawError(plot, { samples: [], frames: [[99, 1, 1]] }, 100, '');
        drawError(plot, { samples: [], frames: [] }, 100, '');
        return said.join(); })()";
    assert_eq!(page.evaluate(notes), json!("no goal: no error,no camera: no error"));
    let lists = |name: &str| {
        format!(
            "(() => {{ const event = (age_ms) => ({{ age_ms, severity: 'alarm', text: 'a fault', \
             advice: '', count: 1 }});
            showEvents({{ state: {{ name: '{name}' }}, events: [event(1000), event(90000)] }}, 0);
            return document.getElementById('alarms').children.length; }})()"
        )
    };
    assert_eq!(page.evaluate(&lists("FAULT")), json!(2));
    assert_eq!(page.evaluate(&lists("ENABLED")), json!(1), "an old fault that is over");
}

/// A picture, for people to look at.
fn pictures_of(page: &mut Browser, name: &str) {
    if std::env::var_os("I2RIS_SCREENSHOTS").is_some() {
        page.screenshot(name);
    }
}

/// Pictures at three widths in both themes, for people to look at.
fn pictures(page: &mut Browser, name: &str) {
    if std::env::var_os("I2RIS_SCREENSHOTS").is_none() {
        return;
    }
    let name = if name.is_empty() { "everything" } else { name };
    for theme in ["dark", "light"] {
        page.evaluate(&format!("setTheme('{theme}')"));
        for size in [[360, 1600], [800, 1400], [1920, 1080]] {
            page.resize(size);
            page.wait("curves", "document.fonts.status === 'loaded'");
            std::thread::sleep(std::time::Duration::from_millis(500));
            page.screenshot(&format!("{name}-{}-{theme}", size[0]));
        }
    }
    page.evaluate("setTheme('dark')");
    page.resize([1280, 800]);
}

#[test]
fn every_width_and_both_themes_hold_everything_and_the_keyboard_reaches_it() {
    let controller = Controller::enabled();
    let served = Served::start(&controller.domain);
    for name in ["", "operator"] {
        let Some(mut page) = served.open(name, [1920, 1080]) else { return };
        page.wait("the state", "document.getElementById('badge')?.textContent === 'ENABLED'");
        for width in [360, 480, 800, 1280, 1920] {
            page.resize([width, 900]);
            page.wait(
                &format!("no sideways scrolling at {width} px"),
                "document.documentElement.scrollWidth <= window.innerWidth",
            );
        }
        pictures(&mut page, name);
        let ground = "getComputedStyle(document.documentElement).backgroundColor";
        let before = page.evaluate(ground);
        page.press("t");
        page.wait("the other theme", &format!("{ground} !== {before}"));
        let canvas = "typeof COLOURS === 'undefined' || COLOURS.text === \
                      getComputedStyle(document.documentElement).getPropertyValue('--text').trim()";
        page.wait("curves in its colours", canvas);
        let mut reached = Vec::new();
        for _ in 0..8 {
            page.press("Tab");
            let id = page.evaluate("document.activeElement.id");
            reached.push(id.as_str().unwrap_or_default().to_owned());
        }
        for wanted in ["other", "theme"] {
            assert!(reached.iter().any(|id| id == wanted), "{wanted}: {reached:?}");
        }
        // Noted and not followed: a page that changes cannot be asked.
        page.evaluate(
            "document.getElementById('other').addEventListener('click', (event) => { \
             event.preventDefault(); window.went = event.currentTarget.href; })",
        );
        page.press("o");
        let other = if name.is_empty() { "operator" } else { "" };
        let expected = json!(format!("http://{}/{other}", served.address));
        page.wait("the other page", &format!("window.went === {expected}"));
        assert!(page.complaints().is_empty(), "{:?}", page.complaints());
    }
}

#[test]
fn a_browser_shows_numbers_that_move_and_says_when_they_are_stale() {
    let mut robot = Rig::with_model();
    let client = robot.enabled();
    let commander = Background::start(move |stop| stream_angles(&client, swing_angles_until(stop)));
    let mut served = Served::start(&robot.domain());
    let url = format!("http://{}/", served.address);
    let Some(mut page) = served.open("", [1920, 1080]) else { return };
    page.wait("the state", "document.getElementById('badge')?.textContent === 'ENABLED'");
    page.wait("motion", &format!("window.first ??= {PITCH}, window.first !== {PITCH}"));
    page.wait(
        "a camera",
        "/[0-9]/.test(document.querySelector('#joints td.camera, #joints td.parted').textContent)",
    );
    page.wait("the hull", "live.hull.length > 20");
    page.wait("frames beside counts", "recent.frames.some((row) => row[3] !== null)");
    page.wait(
        "rates",
        "/^[1-9]/.test(document.querySelectorAll('#motors tr')[1].children[4].textContent)",
    );
    // Every plot has something in every colour that belongs there: it is drawn, not only laid out.
    let drawn = "[...document.querySelectorAll('canvas')].every((c) => new Set(new Uint32Array(\
                 c.getContext('2d').getImageData(0, 0, c.width, c.height).data.buffer)).size > 50)";
    page.wait("curves on every canvas", drawn);
    page.wait(
        "all of it on one screen",
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
