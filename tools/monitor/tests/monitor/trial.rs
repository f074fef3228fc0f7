//! The trial being recorded, on both pages.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use i2ris::clock;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::{TrialMsg, padded_text};
use i2ris::units::Nanos;
use i2ris_needs::needs;
use i2ris_testing::bench::{assert_says, succeeds};
use i2ris_testing::{Background, Controller, TIMEOUT};

use crate::http::Served;
use crate::pages::WHY;

/// Runs a test while a trial is recorded, whose flags are the test's.
fn while_recorded(test: impl FnOnce(&Controller, &AtomicU32)) {
    let controller = Controller::enabled();
    let client = Client::connect(&controller.domain, TIMEOUT).unwrap();
    let mut recorder = client.announcer::<TrialMsg>();
    let flags = Arc::new(AtomicU32::new(0));
    let (published, begun) = (Arc::clone(&flags), clock::now());
    let publishing = Background::start(move |stop| {
        while !stop.load(Ordering::Relaxed) {
            recorder
                .publish(TrialMsg {
                    started_ns: begun.0,
                    mark_ns: begun.0,
                    mark_number: 2,
                    trial: padded_text("P07-joystick-02"),
                    mark: padded_text("contact"),
                    flags: published.load(Ordering::Relaxed),
                    ..TrialMsg::default()
                })
                .unwrap();
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
