//! The page of `i2ris monitor --web` in a browser, with the emulator and the controller as
//! processes.

use serde_json::json;

use crate::chromium::{Browser, find};
use crate::http::Served;
use crate::processes::Robot;

const PITCH: &str = "document.querySelectorAll('#joints td.estimate')[0].textContent";

#[test]
fn a_browser_shows_numbers_that_move_and_says_when_they_are_stale() {
    let Some(chromium) = find() else {
        eprintln!("SKIPPED: no Chromium is installed, so the page was not looked at in a browser");
        return;
    };
    let mut robot = Robot::start();
    let mut served = Served::start(&robot.domain);
    let url = format!("http://{}/", served.address);
    let mut page = Browser::open(&chromium, &url, [1920, 1080]);
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
    for size in [[1920, 1080], [800, 600], [360, 800]] {
        page.resize(size);
        page.wait(
            "no sideways scrolling",
            "document.documentElement.scrollWidth <= window.innerWidth",
        );
    }
    page.resize([1920, 1080]);
    page.wait(
        "all of it on one screen",
        "document.documentElement.scrollHeight <= window.innerHeight",
    );

    robot.freeze();
    page.wait(
        "staleness",
        "document.getElementById('badge').textContent.startsWith('STALE, was ')",
    );
    page.wait(
        "a banner",
        "document.getElementById('banner').textContent.startsWith('STALE: the controller')",
    );
    page.wait("a mark", "document.body.innerText.includes('estimate STALE')");
    robot.thaw();
    page.wait("fresh again", "!document.getElementById('badge').textContent.startsWith('STALE')");
    robot.end_controller();
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
        page.asked_for().into_iter().filter(|address| !address.starts_with(&url)).collect();
    assert!(strange.is_empty(), "{strange:?}");
    assert!(page.asked_for().len() > 10);

    served.program.interrupt();
    page.wait(
        "silence",
        "document.getElementById('banner').textContent.startsWith('THE MONITOR DOES NOT ANSWER')",
    );
}
