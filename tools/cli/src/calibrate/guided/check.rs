//! Check circle, judged by the camera: completing the circle does not mean following it.

use i2ris::clock;
use i2ris::model::Model;
use i2ris::units::Nanos;
use i2ris_report::Failure;

use super::{Guided, Step, words};
use crate::demo::tracking::{TrackingRecorder, rms_deg};

/// Error added by camera and line at 5 deg/s, deg: frames 60 ms late, and noise.
const ADDED_DEG: f64 = 0.5;

const POLL: Nanos = Nanos::from_millis(5);

impl Guided<'_> {
    /// Follows the circle. `Some`: the reason to doubt the result.
    pub fn check(&mut self) -> Result<Option<String>, Failure> {
        // Repeated after a restart: one turn shows whether the zero is still the same.
        let duration_s = if self.progress.was_checked_before() { "6" } else { "18" };
        let circle = ["command", "circle", "--radius-deg", "5", "--period-s", "6"];
        let circle = words(&[&circle[..], &["--duration-s", duration_s, "--enable"]].concat());
        let mut recorder = TrackingRecorder::new(&self.client);
        let mut circle = self.command(&circle)?.spawn()?;
        let mut read = Ok(());
        let status = loop {
            // In every case the circle is waited for or stopped.
            read = read.and_then(|()| recorder.read());
            if let Some(status) = circle.try_wait()? {
                break status;
            }
            clock::sleep(POLL);
        };
        self.check_status(Step::Check, status, status.success())?;
        read?;
        let [.., error] = rms_deg(&recorder.errors_since(0));
        let model = Model::load(&self.arguments.folder.join(self.progress.model_file()))?;
        let limit = 2.0 * stated_deg(&model) + ADDED_DEG;
        Ok((error.is_nan() || error > limit).then(|| {
            let seen = match error.is_nan() {
                true => "the camera did not see the circle".to_owned(),
                false => format!("the camera measured a tracking error of {error:.2} deg RMS"),
            };
            format!(
                "{seen}; the limit is {limit:.2} (twice the stated model error, plus {ADDED_DEG} \
                 for camera and line); `i2ris preflight` shows the cause"
            )
        }))
    }
}

/// Held-out error of the fit, both outputs together, deg.
fn stated_deg(model: &Model) -> f64 {
    let fits = model.file().metrics.iter().map(|it| it.held_out.unwrap_or(it.training).rmsd);
    fits.map(|rmsd| rmsd * rmsd).sum::<f64>().sqrt()
}
