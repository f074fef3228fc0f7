//! `i2ris vision accuracy`: the table of accuracy over synthetic images.

use i2ris_vision::accuracy::{AccuracyRow, clear, cluttered, conditions, rigs, speed, stereo};

use i2ris_report::Failure;
use i2ris_report::while_working;

/// Arguments of `i2ris vision accuracy`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Images per row of the table
    #[arg(long, value_name = "N", default_value_t = 500)]
    frames: u64,
    /// Images with instruments, specks, hairs, covers; 0: none
    #[arg(long, value_name = "N", default_value_t = 10_000)]
    cluttered: u64,
    /// Seed: the same seed gives the same table
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let Arguments { frames, cluttered: cluttered_frames, seed } = *arguments;
    println!(
        "{:<66}{:>7}{:>7}{:>9}{:>8}{:>8}{:>9}{:>8}",
        "images at 1280x960, 200 px/mm, +-45 deg (both axes: +-40)",
        "frames",
        "good",
        "bias",
        "std",
        "max",
        "claimed",
        "tip"
    );
    println!(
        "{:<66}{:>7}{:>7}{:>9}{:>8}{:>8}{:>9}{:>8}",
        "", "", "", "deg", "deg", "deg", "deg", "um"
    );
    for condition in conditions().iter().filter(|_| frames > 0) {
        print_row(&while_working("measuring", || clear(condition, frames, seed)));
    }
    for (name, rig) in rigs().iter().filter(|_| frames > 0) {
        print_row(&while_working("measuring with two views", || stereo(name, rig, frames, seed))?);
    }
    if frames > 0 {
        let rate = while_working("measuring the speed", || speed(seed))?;
        println!(
            "\none view at 1280x960, one thread: {rate:.0} images per second (a camera delivers 30)"
        );
    }
    if cluttered_frames > 0 {
        let outcome =
            while_working("measuring cluttered images", || cluttered(cluttered_frames, seed));
        println!(
            "\n{} cluttered images: {} good, largest error of those {:.3} deg, \
             wrong by more than 1 deg: {}",
            outcome.frames,
            outcome.good,
            outcome.max_deg,
            outcome.wrong.len()
        );
        for (issue, count) in &outcome.issues {
            println!("{count:>7}  {issue}");
        }
        if !outcome.wrong.is_empty() {
            return Err(format!(
                "confident wrong values (number, error in deg): {:?}",
                outcome.wrong
            )
            .into());
        }
    }
    Ok(())
}

fn print_row(row: &AccuracyRow) {
    let AccuracyRow { name, frames, good, bias_deg, std_deg, max_deg, claimed_deg, tip_um } = row;
    println!(
        "{name:<66}{frames:>7}{good:>7}{bias_deg:>+9.4}{std_deg:>8.4}{max_deg:>8.3}\
         {claimed_deg:>9.4}{tip_um:>8.2}"
    );
}
