//! Properties of every report.

use i2ris::model::Model;
use i2ris::model::file::FamilyParameters;

use super::CalibrationReport;
use super::fit::{FamilyResult, Straight};
use super::gather::branches;
use crate::fit::split::HoldOut;
use crate::fit::{Choice, Components, Family, FitOptions, FitOutcome, fit};
use crate::progress::Silent;
use crate::recording::{ReadReport, Recording};
use crate::testing::{few_starts, noise, one_motor, plays_of, recording, straight, wander};

const NASTY: &str = "<i>\"&'</i>.csv";

fn options() -> FitOptions {
    let (choice, components) = (Choice::One(Family::Gmr), Components::Exactly(2));
    FitOptions { em: few_starts(2), choice, components, ..FitOptions::default() }
}

/// A mixture of two components, and the linear model that every fit has.
fn fitted(recording: &Recording) -> FitOutcome {
    fit(recording, &options(), &Silent).unwrap()
}

fn gathered_of(recording: &Recording, outcome: &FitOutcome) -> CalibrationReport {
    CalibrationReport::new(recording, &ReadReport::default(), &options(), outcome)
}

fn gathered(recording: &Recording) -> CalibrationReport {
    gathered_of(recording, &fitted(recording))
}

fn two_axes() -> Recording {
    let mut noise = noise(3);
    recording(400, |time| {
        let counts = wander(time);
        let [pitch, yaw] = straight(counts);
        (counts, [pitch + 0.05 * noise(), yaw + 0.05 * noise()])
    })
}

fn parse(text: &str) -> roxmltree::Document<'_> {
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    roxmltree::Document::parse_with_options(text, options).unwrap()
}

/// Asserts that a report is well-formed, self-contained, and has only finite numbers.
#[track_caller]
fn assert_valid(text: &str) {
    let document = parse(text);
    let without = text.replace("http://www.w3.org/2000/svg", "");
    for part in
        ["http:", "https:", "//", "<script", "<link", "<img", "@import", "NaN", "inf\"", "inf "]
    {
        assert!(!without.contains(part), "{part}");
    }
    let ids: Vec<_> = document.descendants().filter_map(|node| node.attribute("id")).collect();
    let unique: std::collections::HashSet<_> = ids.iter().collect();
    assert_eq!(unique.len(), ids.len(), "identifiers are not unique");
    for svg in document.descendants().filter(|node| node.tag_name().name() == "svg") {
        let named = |name: &str| {
            svg.children().any(|child| child.tag_name().name() == name && child.text().is_some())
        };
        assert!(named("title") && named("desc"), "a figure without words");
    }
}

#[test]
fn a_report_has_all_figures_and_numbers() {
    let recording = two_axes();
    let data = gathered(&recording);
    let text = data.html();
    assert_valid(&text);
    let is_figure = |node: &roxmltree::Node<'_, '_>| node.tag_name().name() == "svg";
    assert_eq!(parse(&text).descendants().filter(is_figure).count(), 3);
    assert!(text.contains(recording.sha256()));
    assert!(text.contains("100 row(s): 5 blocks all over the recording; 8 outside the training"));
    for family in &data.families {
        let (metrics, held_out) = (&family.metrics, family.held_out.as_ref().unwrap());
        let squares = metrics.iter().map(|output| output.held_out.unwrap().rmsd.powi(2));
        assert!((held_out.rms_length - squares.sum::<f64>().sqrt()).abs() < 1e-9);
        assert_eq!(family.model_id.len(), 64);
        assert!(text.contains(&family.model_id), "{}", family.name);
    }
    for part in ["R²", "RMSD", "NRMSD", "MAE", "p99", "max", "fit (s)", "gmr (K = "] {
        assert!(text.contains(part), "{part}");
    }
}

#[test]
fn choice_by_the_error_and_a_larger_error_are_mentioned() {
    let mut data = gathered(&two_axes());
    let texts = [
        "chosen among 2 by its error on the held-out rows, and by its inverse where that was \
         tried, so that error is too optimistic",
        "on rows held out is 2.1 times that in training: it does not generalise",
    ];
    assert!(texts.iter().all(|text| !data.html().contains(text)));
    data.chosen_by_held_out = true;
    for FamilyResult { training, held_out, .. } in &mut data.families {
        held_out.as_mut().unwrap().rms_length = 2.1 * training.as_ref().unwrap().rms_length;
    }
    assert!(texts.iter().all(|text| data.html().contains(text)));
}

#[test]
fn names_are_escaped() {
    let mut data = gathered(&two_axes());
    for name in [&mut data.robot_id, &mut data.recording.name, &mut data.software] {
        *name = NASTY.to_owned();
    }
    for output in &mut data.outputs {
        output.name = NASTY.to_owned();
    }
    for family in &mut data.families {
        family.name = NASTY.to_owned();
        family.title = NASTY.to_owned();
    }
    data.settings.push((NASTY.to_owned(), NASTY.to_owned()));
    data.warnings.push(NASTY.to_owned());
    let text = data.html();
    assert_valid(&text);
    let document = parse(&text);
    assert!(document.descendants().all(|node| node.tag_name().name() != "i"));
    let is_nasty =
        |node: roxmltree::Node<'_, '_>| node.text().is_some_and(|text| text.contains(NASTY));
    for name in ["h1", "li", "td", "th", "text", "figcaption"] {
        let mut all = document.descendants().filter(|node| node.tag_name().name() == name);
        assert!(all.any(|node| node.descendants().any(is_nasty)), "{name}");
    }
}

#[test]
fn empty_data_make_a_report_too() {
    assert_valid(&CalibrationReport::default().html());
    let mut data = gathered(&two_axes());
    for family in &mut data.families {
        family.chosen = false;
    }
    data.recording.held_out = 0;
    let text = data.html();
    assert_valid(&text);
    assert!(text.contains("No rows were held out"));
    data.families.clear();
    assert_valid(&data.html());
}

/// Rows of noise, the worst case for thinning.
#[test]
fn thirty_thousand_rows_stay_below_two_megabytes() {
    let mut data = gathered(&two_axes());
    let mut noise = noise(9);
    let rows = 30_000;
    let track = &mut data.track;
    track.time = (0..rows).map(|row| row as f64 / 30.0).collect();
    track.counts = (0..rows).map(|_| [900.0 * noise(), 900.0 * noise()]).collect();
    track.rising = (0..rows).map(|_| [noise() > 0.0; 3]).collect();
    track.measured = (0..rows).map(|_| [20.0 * noise(), 20.0 * noise(), 0.0]).collect();
    data.families.extend(data.families.clone());
    data.families.extend(data.families[..2].to_vec());
    let size = data.html().len();
    assert!((100_000..2_000_000).contains(&size), "{size} bytes");
}

#[test]
fn directions_follow_the_counts_and_not_their_flicker() {
    // Up to 100 and down again, by 2 counts a row with a flicker of half a count.
    let recording = one_motor(100, |time| {
        let row = time / 0.2;
        let flicker = if (row as i64) % 2 == 0 { 0.25 } else { -0.25 };
        ((100.0 - 2.0 * (row - 50.0).abs()) + flicker, row)
    });
    let (choice, hold_out) = (Choice::One(Family::Linear), HoldOut::Fraction(0.6));
    let options = FitOptions { choice, hold_out, force: true, ..FitOptions::default() };
    let outcome = fit(&recording, &options, &Silent).unwrap();
    let track = gathered_of(&recording, &outcome).track;
    let rising: Vec<bool> = track.rising.iter().map(|now| now[0]).collect();
    assert!(rising[..51].iter().all(|up| *up), "{rising:?}");
    assert!(rising[52..].iter().all(|up| !*up), "{rising:?}");
}

/// A play of half-width r splits a straight line into two, 2 r counts apart.
#[test]
fn branches_are_apart_by_the_width_of_the_play() {
    let mut noise = noise(7);
    let recording = one_motor(300, |time| {
        let count = (400.0 * (0.7 * time).sin()).round();
        (count, 0.02 * count + 0.01 * noise())
    });
    let outcome = fitted(&recording);
    let mut file = outcome.model.file().clone();
    let FamilyParameters::Gmr { mixture } = file.family else { panic!("not a mixture") };
    file.family = FamilyParameters::GmrPlay {
        plays: plays_of(vec![vec![0.0, 50.0]], vec![vec![0.2, 0.8]]),
        mixture,
        residual: None,
        virtual_hull: file.hull.clone(),
    };
    let model = Model::from_file(file).unwrap();
    let line = Straight { gain: [0.02, 0.0], offset: 0.0 };
    let unit = std::f64::consts::PI / 180.0;
    let found = branches(&model, 0, &line, unit);
    let middle = found.rising.len() / 2;
    let (up, down) = (found.rising[middle], found.falling[found.falling.len() - 1 - middle]);
    // The lagging play carries 0.8 of the virtual counts: 0.8 * 2 * 50 counts of 0.02 deg.
    assert!(
        (up[0] - down[0]).abs() < 1e-6 && ((down[1] - up[1]) - 1.6).abs() < 0.02,
        "{up:?} {down:?}"
    );
    let memoryless = branches(&outcome.model, 0, &line, unit);
    let mut pairs = memoryless.rising.iter().zip(memoryless.falling.iter().rev());
    assert!(pairs.all(|(up, down)| up[1] == down[1]));
}
