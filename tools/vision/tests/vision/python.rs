//! The Python package, in the Python that `I2RIS_PYTHON` names, otherwise `python3`. `pip install
//! 'tools/python[markers,publish,test]'` makes one.

use std::process::Output;

use i2ris::clock;
use i2ris::ipc::payload::ExternalPosition;
use i2ris_needs::needs;
use i2ris_testing::{python, serve, unique_domain, wait_until};

fn assert_success(output: &Output) {
    let (out, err) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{out}{err}");
}

#[needs("python: cv2, numpy, pytest")]
#[test]
fn the_tests_of_the_python_package_pass() {
    assert_success(
        &python().args(["-m", "pytest", "-q", "-p", "no:cacheprovider"]).output().unwrap(),
    );
}

#[needs("python: iceoryx2")]
#[test]
fn what_python_publishes_reaches_the_controller() {
    let domain = unique_domain();
    let mut server = serve(&domain);
    let script = include_str!("python/publish.py");
    let before = clock::now().0;
    let child = python()
        .args(["-c", script, domain.name()])
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut seen: Vec<ExternalPosition> = Vec::new();
    wait_until("nothing is published", || {
        server.maintain(clock::now());
        seen.extend(server.poll_external());
        seen.last().is_some_and(|last| last.flags == 0)
    });
    let output = child.wait_with_output().unwrap();
    assert_success(&output);
    assert!(
        String::from_utf8_lossy(&output.stdout).contains("no controller serves domain nobody-")
    );
    let first = seen.first().unwrap();
    assert_eq!((first.position, first.deviation), ([0.1, -0.2, 0.0], [0.001, 0.002, 0.0]));
    assert_eq!((first.quality, first.count, first.flags), (0.75, 2, ExternalPosition::VALID));
    assert!(
        first.stamp_ns > before && first.stamp_ns < clock::now().0,
        "one clock for both languages"
    );
    assert!(seen.windows(2).all(|pair| pair[0].sequence < pair[1].sequence));
    assert_eq!(seen.last().unwrap().flags, 0);
}
