//! The laboratory's own recording of the robot. It is not part of the repository.

#![allow(clippy::unwrap_used)]

use std::path::PathBuf;

use i2ris_calibration::em::EmOptions;
use i2ris_calibration::fit::family::Family;
use i2ris_calibration::fit::flatness::{FlatSpot, flat_spot};
use i2ris_calibration::fit::split::HoldOut;
use i2ris_calibration::fit::{Choice, Components, FitOptions, fit};
use i2ris_calibration::progress::Silent;
use i2ris_calibration::quality::Finding;
use i2ris_calibration::recording::{ColumnMap, ReadReport, Recording};
use i2ris_calibration::regression::linear::fit_linear;
use i2ris_calibration::table::DataTable;
use i2ris_needs::needs;

fn recording() -> (Recording, ReadReport) {
    read("i2ris/output_w_angles.csv")
}

fn read(name: &str) -> (Recording, ReadReport) {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name);
    Recording::read(&path, &ColumnMap::default()).unwrap()
}

#[needs("file: ../../../shared/data/i2ris")]
#[test]
fn the_file_is_read_as_it_is() {
    let (recording, report) = recording();
    assert_eq!((report.rows, recording.rows().len()), (249, 244));
    assert_eq!(
        report.dropped.iter().map(|row| row.line).collect::<Vec<_>>(),
        [38, 74, 97, 155, 160]
    );
    assert!(report.dropped.iter().all(|row| row.column == "yaws"));
    let first = recording.rows()[0];
    assert_eq!(
        (first.line, first.time_s, first.counts),
        (2, Some(1_746_051_712.544_110_3), [257.0, -237.0])
    );
    assert_eq!(first.outputs, [0.025_360_903_652_710_93, -2.566_746_434_736_078_4, 0.0]);
}

#[needs("file: ../../../shared/data/i2ris")]
#[test]
fn a_mixture_fits_the_held_out_turn_better_than_linear() {
    let (recording, _) = recording();
    let options = FitOptions {
        choice: Choice::One(Family::Gmr),
        em: EmOptions { restarts: 5, ..EmOptions::default() },
        hold_out: HoldOut::LastCycle,
        ..FitOptions::default()
    };
    let outcome = fit(&recording, &options, &Silent).unwrap();
    assert_eq!(outcome.report.split.held_out().count(), 63);
    let mixture = outcome.model.file().metrics.iter();
    for (gmr, linear) in mixture.zip(&outcome.linear.file().metrics) {
        assert!(gmr.training.rmsd < linear.training.rmsd);
        assert!(gmr.held_out.unwrap().rmsd < linear.held_out.unwrap().rmsd);
    }
}

#[needs("file: ../../../shared/data/i2ris")]
#[test]
fn its_noise_and_its_limits_are_reported() {
    let (recording, _) = recording();
    let options = FitOptions {
        em: EmOptions { restarts: 1, ..EmOptions::default() },
        ..FitOptions::default()
    };
    let quality = fit(&recording, &options, &Silent).unwrap().report.quality;
    let noise: Vec<_> = quality.noise.iter().map(|noise| noise.unwrap().deviation).collect();
    assert!((noise[0] - 0.2).abs() < 0.05 && (noise[1] - 0.4).abs() < 0.05, "{noise:?}");
    assert!(quality.spikes.is_empty());
    let [Finding::Circulation { turns }] = quality.warnings[..] else {
        panic!("{:?}", quality.warnings)
    };
    assert!((turns - 3.97).abs() < 0.01);
}

/// Position where the mixture of this many components is flatter than the recording shows.
fn flat(recording: &Recording, components: usize) -> Option<FlatSpot> {
    let options = FitOptions {
        choice: Choice::One(Family::Gmr),
        components: Components::Exactly(components),
        em: EmOptions { restarts: 5, ..EmOptions::default() },
        hold_out: HoldOut::LastCycle,
        ..FitOptions::default()
    };
    let outcome = fit(recording, &options, &Silent).unwrap();
    let rows = || outcome.report.training.iter().map(|row| &recording.rows()[*row]);
    let inputs = DataTable::from_rows(recording.motors(), rows().map(|row| row.counts));
    let outputs = DataTable::from_rows(recording.outputs().len(), rows().map(|row| row.outputs));
    flat_spot(&outcome.model, &inputs, &outputs, &fit_linear(&inputs, &outputs).unwrap())
}

#[needs("file: ../../../shared/data/i2ris")]
#[test]
fn no_number_of_components_is_flat_inside_the_ring() {
    let (recording, _) = recording();
    for components in 1..=12 {
        assert_eq!(flat(&recording, components), None, "{components} components");
    }
}

#[needs("file: ../../../shared/data/tee_probe")]
#[test]
fn the_slack_zone_of_the_echo_probe_is_accepted() {
    for name in ["tee_probe/motor1_first.csv", "tee_probe/motor1_second.csv"] {
        let (recording, _) = read(name);
        for components in [4, 6] {
            assert_eq!(flat(&recording, components), None, "{name}, {components} components");
        }
    }
}
