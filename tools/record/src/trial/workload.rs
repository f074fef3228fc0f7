//! NASA-TLX: workload of the participant in a trial on six scales (Hart and Staveland, in Human
//! Mental Workload, 1988, p. 139), without weights (raw TLX: Hart, Proc. HFES 50, 904, 2006).

use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// Name, question, and what 0 and 100 mean.
pub const SCALES: [(&str, &str, [&str; 2]); 6] = [
    ("mental", "How mentally demanding was the task?", ["very low", "very high"]),
    ("physical", "How physically demanding was the task?", ["very low", "very high"]),
    ("temporal", "How hurried or rushed was the pace of the task?", ["very low", "very high"]),
    (
        "performance",
        "How successful were you in accomplishing what you were asked to do?",
        ["perfect", "failure"],
    ),
    (
        "effort",
        "How hard did you have to work to accomplish your level of performance?",
        ["very low", "very high"],
    ),
    (
        "frustration",
        "How insecure, discouraged, irritated, stressed and annoyed were you?",
        ["very low", "very high"],
    ),
];

/// Reason why an answer is invalid.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum WorkloadError {
    #[error("`{0}` is not an answer: 0 to 100 in steps of 5")]
    Answer(String),
    #[error("{0} answers for six scales: {names}", names = names())]
    Count(usize),
}

fn names() -> String {
    SCALES.map(|(name, ..)| name).join(", ")
}

/// The answers, in the order of [`SCALES`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Workload(pub [u8; 6]);

impl Workload {
    /// One answer.
    pub fn answer(text: &str) -> Result<u8, WorkloadError> {
        let answer = text.trim().parse::<u8>().ok();
        let answer = answer.filter(|answer| *answer <= 100 && answer.is_multiple_of(5));
        answer.ok_or_else(|| WorkloadError::Answer(text.trim().to_owned()))
    }

    /// The workload: the mean of the scales.
    pub fn mean(&self) -> f64 {
        self.0.iter().map(|answer| f64::from(*answer)).sum::<f64>() / 6.0
    }
}

impl FromStr for Workload {
    type Err = WorkloadError;

    fn from_str(text: &str) -> Result<Self, WorkloadError> {
        let answers = text.split(',').map(Self::answer).collect::<Result<Vec<_>, _>>()?;
        let count = answers.len();
        Ok(Self(answers.try_into().map_err(|_| WorkloadError::Count(count))?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn six_answers_are_a_workload_and_others_are_refused() {
        let workload: Workload = "55, 30,25,0,100,0".parse().unwrap();
        assert_eq!((workload.0, workload.mean()), ([55, 30, 25, 0, 100, 0], 35.0));
        for (bad, part) in [
            ("", "`` is not an answer"),
            ("7", "steps of 5"),
            ("105", "0 to 100"),
            ("55,30,25,0,100", "5 answers for six scales: mental, physical"),
            ("55,30,25,0,100,0,0", "7 answers"),
        ] {
            let error = bad.parse::<Workload>().unwrap_err().to_string();
            assert!(error.contains(part), "{bad}: {error}");
        }
    }
}
