//! The participants of a study: their codes, the order in which they meet the conditions, and the
//! workload that they report. Anything that looks like a name, a date of birth or an address is
//! refused: a study stores no personal data.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CodeError {
    #[error("`{0}` looks like an e-mail address; give a code such as P07: no person is stored")]
    Address(String),
    #[error("`{0}` looks like a date; give a code such as P07: no date of birth is stored")]
    Date(String),
    #[error("`{0}` looks like a name; give a code such as P07: letters, then a number")]
    Name(String),
    #[error("`{0}` is not a code: one to three capital letters and a number, such as P07")]
    Form(String),
    #[error(
        "`{new}` reads like {known}, a different code in this study; write {known}, or use a \
             different number"
    )]
    Alike { new: Participant, known: Participant },
    #[error("`{0}` is not a condition: small letters, digits and -, at most 24, such as joystick")]
    Condition(String),
}

/// A participant: `P07`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String")]
pub struct Participant(String);

impl FromStr for Participant {
    type Err = CodeError;

    fn from_str(text: &str) -> Result<Self, CodeError> {
        let owned = || text.to_owned();
        let letters = text.chars().take_while(char::is_ascii_uppercase).count();
        let digits = &text[text.char_indices().nth(letters).map_or(text.len(), |(at, _)| at)..];
        let is_number = !digits.is_empty() && digits.chars().all(|c| c.is_ascii_digit());
        if (1..=3).contains(&letters) && is_number && digits.len() <= 4 {
            return Ok(Self(owned()));
        }
        let count = text.chars().filter(char::is_ascii_digit).count();
        Err(if text.contains('@') {
            CodeError::Address(owned())
        } else if count >= 5 {
            CodeError::Date(owned())
        } else if count == 0 && text.chars().any(char::is_alphabetic) {
            CodeError::Name(owned())
        } else {
            CodeError::Form(owned())
        })
    }
}

impl Participant {
    /// The letters and the number: `P7` and `P07` have the same.
    fn key(&self) -> (String, u32) {
        let letters = self.0.trim_end_matches(|c: char| c.is_ascii_digit());
        (letters.to_owned(), self.0[letters.len()..].parse().unwrap_or(0))
    }

    /// Refuses a code that could be confused with a different one of the study.
    pub fn check_distinct(&self, known: impl IntoIterator<Item = Self>) -> Result<(), CodeError> {
        let alike = known.into_iter().find(|other| other != self && other.key() == self.key());
        alike.map_or(Ok(()), |known| Err(CodeError::Alike { new: self.clone(), known }))
    }
}

/// A condition: `joystick`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String")]
pub struct Condition(String);

impl FromStr for Condition {
    type Err = CodeError;

    fn from_str(text: &str) -> Result<Self, CodeError> {
        let is_good = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        let begins = text.starts_with(|c: char| c.is_ascii_lowercase());
        if begins && text.len() <= 24 && text.chars().all(is_good) {
            Ok(Self(text.to_owned()))
        } else {
            Err(CodeError::Condition(text.to_owned()))
        }
    }
}

macro_rules! text {
    ($($code:ident)*) => {$(
        impl fmt::Display for $code {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(&self.0)
            }
        }

        impl TryFrom<String> for $code {
            type Error = CodeError;

            fn try_from(text: String) -> Result<Self, CodeError> {
                text.parse()
            }
        }
    )*};
}

text!(Participant Condition);

/// The order in which a participant meets the conditions.
///
/// Balanced Latin square (Williams, Aust. J. Sci. Res. A 2, 149, 1949): over its rows every
/// condition is in every place once, and follows every other one equally often. An odd number of
/// conditions needs twice as many rows, the second half reversed.
pub fn order(conditions: usize, participant: usize) -> Vec<usize> {
    if conditions == 0 {
        return Vec::new();
    }
    let rows = if conditions.is_multiple_of(2) { conditions } else { 2 * conditions };
    let row = participant % rows;
    let (shift, is_reversed) = (row % conditions, row >= conditions);
    let place = |column: usize| {
        let first =
            if column.is_multiple_of(2) { conditions - column / 2 } else { column.div_ceil(2) };
        (first + shift) % conditions
    };
    let mut order: Vec<usize> = (0..conditions).map(place).collect();
    if is_reversed {
        order.reverse();
    }
    order
}

/// Scales of NASA-TLX (Hart and Staveland, in Human Mental Workload, 1988, p. 139), without weights
/// (raw TLX: Hart, Proc. HFES 50, 904, 2006): name, question, and what 0 and 100 mean.
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

#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum WorkloadError {
    #[error("`{0}` is not an answer: 0 to 100 in steps of 5")]
    Answer(String),
    #[error("{0} answers for six scales: {s}", s = SCALES.map(|(name, ..)| name).join(", "))]
    Count(usize),
}

/// The answers, in the order of [`SCALES`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Workload(pub [u8; 6]);

impl Workload {
    pub fn answer(text: &str) -> Result<u8, WorkloadError> {
        let answer = text.trim().parse::<u8>().ok();
        let answer = answer.filter(|answer| *answer <= 100 && answer.is_multiple_of(5));
        answer.ok_or_else(|| WorkloadError::Answer(text.trim().to_owned()))
    }

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
    fn codes_are_accepted_and_personal_data_is_refused() {
        for good in ["P07", "S1", "ABC1234"] {
            assert_eq!(good.parse::<Participant>().unwrap().to_string(), good);
        }
        for (bad, part) in [
            ("ann@example.org", "e-mail"),
            ("1990-01-31", "date of birth"),
            ("31.01.1990", "date of birth"),
            ("P19900131", "date of birth"),
            ("Ann", "looks like a name"),
            ("Müller", "looks like a name"),
            ("P", "looks like a name"),
            ("p07", "is not a code"),
            ("P-07", "is not a code"),
            ("../P07", "is not a code"),
            ("", "is not a code"),
        ] {
            let error = bad.parse::<Participant>().unwrap_err().to_string();
            assert!(error.contains(part), "{bad}: {error}");
        }
        for bad in ["", "Joystick", "a b", "../x", "1st", "-a", "ä"] {
            assert!(bad.parse::<Condition>().is_err(), "{bad}");
        }
    }

    #[test]
    fn code_that_reads_like_a_known_one_is_refused() {
        let code = |text: &str| text.parse::<Participant>().unwrap();
        assert_eq!(code("P07").check_distinct([code("P07"), code("P08"), code("S7")]), Ok(()));
        let error = code("P7").check_distinct([code("P07")]).unwrap_err().to_string();
        assert!(error.contains("reads like P07"), "{error}");
    }

    #[test]
    fn conditions_are_balanced_by_place_and_predecessor() {
        for count in 1..=6 {
            let rows = if count % 2 == 0 { count } else { 2 * count };
            let mut places = vec![vec![0; count]; count];
            let mut follows = vec![vec![0; count]; count];
            for participant in 0..rows {
                let row = order(count, participant);
                for (place, condition) in row.iter().enumerate() {
                    places[*condition][place] += 1;
                }
                for pair in row.windows(2) {
                    follows[pair[0]][pair[1]] += 1;
                }
            }
            assert!(places.iter().flatten().all(|times| *times == rows / count), "{count}");
            let times = rows / count;
            let mut pairs = (0..count).flat_map(|a| (0..count).map(move |b| (a, b)));
            let is_balanced = pairs.all(|(a, b)| follows[a][b] == if a == b { 0 } else { times });
            assert!(is_balanced, "{count}: {follows:?}");
        }
    }

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
