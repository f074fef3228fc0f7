//! `i2ris vision scale`: pixels per millimetre from a stage.

use std::path::{Path, PathBuf};

use i2ris_vision::fibre::{Reading, measure};
use i2ris_vision::setup::VisionSetup;
use i2ris_vision::source::decode;

use i2ris_report::Failure;

/// Arguments of `i2ris vision scale`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Two images of one view, before and after the stage moved
    #[arg(value_name = "IMAGE", num_args = 2, required = true)]
    images: Vec<PathBuf>,
    /// How far the stage moved, across the line of sight
    #[arg(long, value_name = "MM")]
    moved_mm: f64,
    /// Description of the views; its scale has to be right to a fifth
    #[arg(long, value_name = "FILE", default_value = "config/vision.toml")]
    setup: PathBuf,
    /// Name of the view in the setup [default: the first]
    #[arg(long, value_name = "NAME")]
    view: Option<String>,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let setup = VisionSetup::load(&arguments.setup)?;
    let named = |name: &String| setup.views.iter().find(|view| view.name == *name);
    let view = match &arguments.view {
        None => setup.views.first(),
        Some(name) => named(name),
    }
    .ok_or("the setup has no such view")?;
    if !(arguments.moved_mm.is_finite() && arguments.moved_mm > 0.0) {
        return Err("--moved-mm must be above 0".into());
    }
    let read = |path: &Path| -> Result<Reading, Failure> {
        let failed = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
        let bytes = std::fs::read(path).map_err(|error| failed(&error))?;
        let image = decode(&bytes).map_err(|error| failed(&error))?;
        let reading = measure(&image, &view.settings()).map_err(|issue| failed(&issue))?;
        match reading.issue {
            Some(issue) => Err(failed(&issue).into()),
            None => Ok(reading),
        }
    };
    let (before, after) = (read(&arguments.images[0])?, read(&arguments.images[1])?);
    let turned = (after.angle_rad - before.angle_rad).to_degrees().abs();
    if turned > 0.5 {
        return Err(format!(
            "the snake bent by {turned:.1} deg between both images; hold it still"
        )
        .into());
    }
    let moved = (after.tip_px[0] - before.tip_px[0]).hypot(after.tip_px[1] - before.tip_px[1]);
    if moved < 20.0 {
        return Err(format!("the tip moved by {moved:.1} px only; move the stage farther").into());
    }
    println!(
        "px_per_mm = {:.3}   # view {}: tip moved by {moved:.2} px",
        moved / arguments.moved_mm,
        view.name
    );
    Ok(())
}
