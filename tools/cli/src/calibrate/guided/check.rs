//! Check circle, judged by the camera: completing the circle does not mean following it.

use i2ris::clock;
use i2ris::model::Model;
use i2ris::units::Nanos;
use i2ris_report::{Failure, Interrupt};

use super::progress::Progress;
use super::{Guided, Step, stopped};
use crate::demo::tracking::{TrackingRecorder, rms_deg};

/// Error added by camera and line at 5 deg/s, deg: frames 60 ms late, and noise.
const ADDED_DEG: f64 = 0.5;

const POLL: Nanos = Nanos::from_millis(5);

impl Guided {
    /// Follows the circle. `Some`: the reason to doubt the result.
    pub fn check(
        &mut self,
        progress: &Progress,
        interrupt: &Interrupt,
    ) -> Result<Option<String>, Failure> {
        let mut doubt = None;
        for words in self.commands(Step::Check, progress)? {
            let mut recorder = TrackingRecorder::new(&self.client);
            let mut circle = self.command(&words)?.spawn()?;
            let mut read = Ok(());
            let status = loop {
                // In every case the circle is waited for or stopped.
                read = read.and_then(|()| recorder.read());
                if let Some(status) = circle.try_wait()? {
                    break status;
                }
                clock::sleep(POLL);
            };
            if !status.success() || interrupt.came() {
                return Err(stopped(Step::Check, status, interrupt.came()).into());
            }
            read?;
            let [.., error] = rms_deg(&recorder.errors_since(0));
            let stated = stated_deg(&Model::load(&self.folder.join(progress.model_file()))?);
            let limit = 2.0 * stated + ADDED_DEG;
            doubt = (error.is_nan() || error > limit).then(|| {
                let seen = match error.is_nan() {
                    true => "the camera did not see the circle".to_owned(),
                    false => format!("the camera measured a tracking error of {error:.2} deg RMS"),
                };
                format!(
                    "{seen}; the limit is {limit:.2} (twice the stated model error, plus \
                     {ADDED_DEG} for camera and line); `i2ris preflight` shows the cause"
                )
            });
        }
        Ok(doubt)
    }
}

/// Held-out error of the fit, both outputs together, deg.
fn stated_deg(model: &Model) -> f64 {
    let fits = model.file().metrics.iter().map(|it| it.held_out.unwrap_or(it.training).rmsd);
    fits.map(|rmsd| rmsd * rmsd).sum::<f64>().sqrt()
}
