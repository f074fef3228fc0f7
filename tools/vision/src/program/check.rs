//! `i2ris vision check`: what the detector sees, for a person to look at.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use i2ris_vision::drawing::{Canvas, ContactSheet, overlay};
use i2ris_vision::image::GreyImage;
use i2ris_vision::setup::VisionSetup;
use i2ris_vision::view_detector::{ViewDetector, ViewResult};

use super::input::{Format, check_count};
use i2ris_report::Failure;

/// Arguments of `i2ris vision check`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Images of each view of the setup: a folder, a file, a FIFO, or `-` for the standard input
    #[arg(value_name = "IMAGES", num_args = 1..=2, required = true)]
    images: Vec<PathBuf>,
    /// Description of the views
    #[arg(long, value_name = "FILE", default_value = "config/vision.toml")]
    setup: PathBuf,
    #[command(flatten)]
    format: Format,
    /// Where to write a page of small images, PNG
    #[arg(long, value_name = "FILE", required_unless_present = "overlays")]
    sheet: Option<PathBuf>,
    /// Folder for one image per image
    #[arg(long, value_name = "DIR")]
    overlays: Option<PathBuf>,
    /// Show only every Nth image
    #[arg(long, value_name = "N", default_value_t = 1)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..))]
    every: u32,
    /// Maximum number of images of each view
    #[arg(long, value_name = "N", default_value_t = 48)]
    most: usize,
    /// Small images per row of the page
    #[arg(long, value_name = "N", default_value_t = 6)]
    columns: usize,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let setup = VisionSetup::load(&arguments.setup)?;
    check_count(&arguments.images, &setup, &arguments.setup)?;
    if let Some(folder) = &arguments.overlays {
        fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    }
    let mut sheet = ContactSheet::default();
    for (view, path) in setup.views.iter().zip(&arguments.images) {
        let mut counts: BTreeMap<String, usize> = BTreeMap::new();
        let mut source = arguments.format.open(path)?;
        let mut detector = ViewDetector::new(view.settings());
        let mut number = 0_usize;
        let mut shown = 0;
        while shown < arguments.most {
            let Some(item) = source.next()? else { break };
            let result = detector.detect(item);
            number += 1;
            let words =
                result.good().err().map_or_else(|| "good".to_owned(), |cause| cause.to_string());
            *counts.entry(words).or_default() += 1;
            if !(number - 1).is_multiple_of(arguments.every as usize) {
                continue;
            }
            shown += 1;
            let canvas = draw(&format!("{} {}", view.name, result.name), &result);
            if let Some(folder) = &arguments.overlays {
                canvas.save(&folder.join(format!("{}_{number:05}.png", view.name)))?;
            }
            sheet.add(&canvas);
        }
        println!("view {}: {number} images looked at, {shown} shown", view.name);
        for (words, count) in counts {
            println!("{count:>7}  {words}");
        }
    }
    if let Some(path) = &arguments.sheet {
        sheet.page(arguments.columns).save(path)?;
        println!("wrote {}", path.display());
    }
    Ok(())
}

/// The overlay of an image, or a dark card that says why there is none.
fn draw(name: &str, result: &ViewResult) -> Canvas {
    let seen = result.seen.clone().map_err(|cause| cause.to_string());
    let card = GreyImage::new(320, 240, vec![40; 320 * 240]).unwrap_or_else(GreyImage::black);
    overlay(result.image.as_ref().unwrap_or(&card), name, &seen)
}
