//! Tells a release which commit it is made of, for the log of runs.
//!
//! Only a release: in a development build every commit would compile everything anew, and the
//! commit would not say what is in it anyway.

#![allow(clippy::print_stdout)] // That is how a build script talks to cargo.

use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if std::env::var("PROFILE").as_deref() != Ok("release") {
        return;
    }
    // The log of HEAD grows with every commit and checkout; the sources decide whether the work
    // tree is that commit.
    for path in ["src", "Cargo.toml", "Cargo.lock"] {
        println!("cargo::rerun-if-changed={path}");
    }
    if let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"]) {
        println!("cargo::rerun-if-changed={log}");
    }
    if let Some(commit) = git(&["rev-parse", "HEAD"]) {
        let changed =
            git(&["status", "--porcelain", "--", "src", "Cargo.toml", "Cargo.lock"]).is_some();
        println!(
            "cargo::rustc-env=I2RIS_COMMIT={commit}{}",
            if changed { " with changes" } else { "" }
        );
    }
}

/// What git says, if it is there and has something to say.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git")
        .args(arguments)
        .output()
        .ok()
        .filter(|output| output.status.success())?;
    let text = String::from_utf8(output.stdout).ok()?;
    Some(text.trim().to_owned()).filter(|text| !text.is_empty())
}
