//! What both pages say at the moment, in a browser: reasons, commander, faults; every width, both
//! themes, and the keyboard.

use i2ris::ipc::client::{Client, ExternalPublisher};
use i2ris::ipc::{Fault, OperatingState, Refusal};
use i2ris::robot::{Cause, Clip, Excess, Quantity, Reason};
use i2ris::units::Nanos;
use serde_json::json;

use crate::chromium::{Browser, find};
use crate::http::Served;
use i2ris_testing::Controller;

const WHY: &str = "document.getElementById('why')?.innerText";

fn reason(cause: Cause, excess: Excess) -> Reason {
    Reason { cause, excess: Some(excess) }
}

#[test]
fn both_pages_say_at_once_why_the_robot_does_not_follow() {
    let Some(chromium) = find() else {
        eprintln!("SKIPPED: no Chromium is installed, so the pages were not looked at");
        return;
    };
    let controller = Controller::enabled();
    let served = Served::start(&controller.domain);
    let mut pages = ["", "operator"].map(|page| {
        let url = format!("http://{}/{page}", served.address);
        Browser::open(&chromium, &url, [1280, 800])
    });
    for page in &mut pages {
        let present = format!("{WHY}?.startsWith('refusal 7: no model is loaded; do: ')");
        page.wait("what keeps it now", &present);
    }
    let step = Excess::new(Quantity::Degrees, 9.25, Some(2.0));
    let clip = Excess::new(Quantity::Degrees, 1.5, None);
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
    let fault = Excess::new(Quantity::Counts, 2314.0, Some(2000.0)).of_motor(1);
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
        let noise = Excess::new(Quantity::Degrees, f64::from(number), Some(2.0));
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
    let Some(chromium) = find() else {
        eprintln!("SKIPPED: no Chromium is installed, so the pages were not looked at");
        return;
    };
    let controller = Controller::enabled();
    let served = Served::start(&controller.domain);
    let client = Client::connect(&controller.domain, Nanos::from_millis(20_000)).unwrap();
    let mut commander = client.commander();
    let mut camera = ExternalPublisher::new(&controller.domain);
    let url = format!("http://{}/", served.address);
    let mut page = Browser::open(&chromium, &url, [1280, 800]);
    page.wait("the page", "document.getElementById('lease') !== null");
    let name = std::env::current_exe().unwrap();
    let name: String = { name.file_name().unwrap().to_str().unwrap() }.chars().take(10).collect();
    let named = json!(format!("commander: {name}"));
    let (pid, mut is_named, mut is_parted) = (std::process::id(), false, false);
    for _ in 0..600 {
        commander.servo_jp(&[0.02, -0.02]).unwrap();
        let now = i2ris::clock::now();
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
fn angles_of_two_digits_fit_into_their_panel() {
    let Some(chromium) = find() else {
        eprintln!("SKIPPED: no Chromium is installed, so the page was not looked at");
        return;
    };
    let controller = Controller::enabled();
    controller.robot().pose = [-28.65, -34.38];
    let served = Served::start(&controller.domain);
    let mut camera = ExternalPublisher::new(&controller.domain);
    let url = format!("http://{}/", served.address);
    let mut page = Browser::open(&chromium, &url, [1280, 900]);
    page.wait("the page", "document.getElementById('joints') !== null");
    for size in [[1280, 900], [1920, 1080], [800, 1400], [360, 1600]] {
        page.resize(size);
        let is_shown = "['estimate', 'camera'].every(name => \
            document.querySelector(`#joints td.${name}`)?.textContent === '−28.65')";
        let shown = (0..600).any(|_| {
            let now = i2ris::clock::now();
            camera.publish(now, &[-0.500_037, -0.600_044], &[]).unwrap();
            page.evaluate(is_shown) == json!(true)
        });
        assert!(shown, "{}", page.evaluate("document.body.innerText"));
        let too_wide = "[...document.querySelectorAll('#numbers table')]
            .filter(table => table.scrollWidth > table.parentElement.clientWidth - 20)
            .map(table => `${table.id} ${table.scrollWidth}`).join()";
        assert_eq!(page.evaluate(too_wide), json!(""), "at {size:?}");
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
    let Some(chromium) = find() else {
        eprintln!("SKIPPED: no Chromium is installed, so the pages were not looked at");
        return;
    };
    let controller = Controller::enabled();
    let served = Served::start(&controller.domain);
    for name in ["", "operator"] {
        let url = format!("http://{}/{name}", served.address);
        let mut page = Browser::open(&chromium, &url, [1920, 1080]);
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
