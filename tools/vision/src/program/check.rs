//! `i2ris vision check`: what the detector sees, for a person to look at.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use i2ris_vision::fibre::Reading;
use i2ris_vision::image::Grey;
use i2ris_vision::look::{Cause, Eye, Look};
use i2ris_vision::setup::Setup;
use i2ris_vision::show::{Paper, Sheet, overlay};

use super::input::Format;
use i2ris_terminal::Failure;

/// Arguments of `i2ris vision check`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Pictures of each view of the setup: a folder, a file, a FIFO, or `-` for the standard input
    #[arg(value_name = "PICTURES", num_args = 1..=2, required = true)]
    pictures: Vec<PathBuf>,
    /// What is known about the views
    #[arg(long, value_name = "FILE", default_value = "config/vision.toml")]
    setup: PathBuf,
    #[command(flatten)]
    format: Format,
    /// Where to write a page of small pictures, PNG
    #[arg(long, value_name = "FILE", required_unless_present = "overlays")]
    sheet: Option<PathBuf>,
    /// Folder for one picture per picture
    #[arg(long, value_name = "DIR")]
    overlays: Option<PathBuf>,
    /// Show every so manieth picture
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    every: u32,
    /// Show at most so many of each view
    #[arg(long, value_name = "N", default_value_t = 48)]
    most: usize,
    /// Small pictures per row of the page
    #[arg(long, value_name = "N", default_value_t = 6)]
    columns: usize,
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let setup = Setup::load(&arguments.setup)?;
    if arguments.pictures.len() != setup.views.len() {
        let (given, wanted) = (arguments.pictures.len(), setup.views.len());
        return Err(format!(
            "{given} sources of pictures for {wanted} views in {}",
            arguments.setup.display()
        )
        .into());
    }
    if let Some(folder) = &arguments.overlays {
        fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    }
    let mut sheet = Sheet::new(arguments.columns);
    for (view, path) in setup.views.iter().zip(&arguments.pictures) {
        let mut counts: BTreeMap<String, usize> = BTreeMap::new();
        let mut source = arguments.format.open(path)?;
        let mut eye = Eye::new(view.settings());
        let mut number = 0_usize;
        let mut shown = 0;
        while shown < arguments.most {
            let Some(shot) = source.next()? else { break };
            let look = eye.look(shot);
            number += 1;
            let words = look
                .good()
                .err()
                .map_or_else(|| "good".to_owned(), |cause| cause.to_string());
            *counts.entry(words).or_default() += 1;
            if !(number - 1).is_multiple_of(arguments.every as usize) {
                continue;
            }
            shown += 1;
            let paper = draw(&format!("{} {}", view.name, look.name), &look);
            if let Some(folder) = &arguments.overlays {
                paper.save(&folder.join(format!("{}_{number:05}.png", view.name)))?;
            }
            sheet.add(&paper);
        }
        println!(
            "view {}: {number} pictures looked at, {shown} shown",
            view.name
        );
        for (words, count) in counts {
            println!("{count:>7}  {words}");
        }
    }
    if let Some(path) = &arguments.sheet {
        sheet.page().save(path)?;
        println!("wrote {}", path.display());
    }
    Ok(())
}

/// The overlay of a picture, or a dark card that says why there is none.
fn draw(name: &str, look: &Look) -> Paper {
    let seen: Result<Reading, String> = look.seen.clone().map_err(|cause: Cause| cause.to_string());
    match &look.picture {
        Some(picture) => overlay(picture, name, &seen),
        None => Grey::new(320, 240, vec![40; 320 * 240]).map_or_else(
            || Paper::new(1, 1, [0; 3]),
            |card| overlay(&card, name, &seen),
        ),
    }
}
