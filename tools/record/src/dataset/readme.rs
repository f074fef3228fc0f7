//! The README of a data set: what is known of it, and what is not.

use std::fmt::Write as _;

use super::Dataset;
use super::features::FEATURES;
use super::lerobot::{Writer, view_name};

impl Writer {
    /// The text. What nobody knows stands there as such: a reader shall ask, not guess.
    pub fn readme(&self, dataset: &Dataset) -> String {
        let mut text = "---\nlicense: other\nlicense_name: unknown\ntask_categories:\n- robotics\n\
                    tags:\n- LeRobot\n- i2ris\n- surgical robotics\nconfigs:\n\
                    - config_name: default\n  data_files: data/*/*.parquet\n---\n\n\
                    # Trials of the I2RIS snake robot\n\n"
            .to_owned();
        let rows: usize = dataset.episodes.iter().map(|episode| episode.rows).sum();
        let minutes = rows as f64 / f64::from(dataset.fps.max(1)) / 60.0;
        let mut line = |line: &str| {
            text.push_str(line);
            text.push('\n');
        };
        line(&format!(
            "{} episodes, {rows} rows at {} Hz, {minutes:.1} minutes. A continuum robot 0.9 mm \
             thick with two axes, teleoperated; its wires have hysteresis.\n",
            dataset.episodes.len(),
            dataset.fps
        ));
        line("| | |\n|---|---|");
        for (name, value) in &self.facts {
            line(&format!("| {} | {value} |", name.replace('_', " ")));
        }
        for id in &self.models {
            let digits = id.map(|byte| format!("{byte:02x}")).concat();
            line(&format!("| model | `{digits}` |"));
        }
        for task in self.tasks() {
            line(&format!("| task | {task} |"));
        }
        line("| licence, site, ethics approval | unknown: to be filled in by who publishes |\n");
        line("## Columns\n\n| column | entries | is |\n|---|---|---|");
        for feature in &FEATURES {
            let entries = feature.entries.join(", ");
            line(&format!("| `{}` | {entries} | {} |", feature.name, feature.about));
        }
        for view in &dataset.views {
            let kind = if self.is_video() { "H.264 video" } else { "JPEG as recorded" };
            line(&format!("| `{}` | | Picture of the camera, {kind} |", view_name(view)));
        }
        line(
            "\nAngles are rad, lengths m. There are two actions, because the kinematics of wires \
             are not exact: `action` is absolute, `action.tip_motion` is relative.",
        );
        line(if self.has_view {
            "Right and up are those of the picture, as the hand's view was set or measured.\n"
        } else {
            "No hand said how the picture is turned: right is +yaw, up is +pitch.\n"
        });
        line("## Time\n");
        if dataset.views.is_empty() {
            line("There are no pictures. Rows are at equal distances; the state is interpolated.");
        } else {
            line(
                "A row is at the exposure of its picture; the state is interpolated to it. Readers \
                 of LeRobot take index / fps for its time: `observation.meta.jitter_s` is the \
                 difference. A picture that is missing is stood in for by its neighbour.",
            );
        }
        line("A gap ends an episode: its trial has several parts.\n");
        line("## Episodes\n\n| number | trial | part | outcome | rows | largest jitter (ms) |");
        line("|---|---|---|---|---|---|");
        for (number, episode) in dataset.episodes.iter().enumerate() {
            let outcome = { episode.outcome }
                .map_or_else(|| "unknown".to_owned(), |it| format!("{it:?}").to_lowercase());
            line(&format!(
                "| {number} | {} | {} | {outcome} | {} | {:.2} |",
                episode.trial,
                episode.part,
                episode.rows,
                1e3 * episode.jitter_s
            ));
        }
        if !dataset.left_out.is_empty() {
            let _ = writeln!(text, "\nNot in it:\n");
            for (name, why) in &dataset.left_out {
                let _ = writeln!(text, "- {name}: {why}");
            }
        }
        text
    }
}
