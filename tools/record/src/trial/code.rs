//! Codes of participants and conditions. Anything that looks like a name, a date of birth or an
//! address is refused: a study stores no personal data.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// Reason why a code is invalid.
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
#[serde(try_from = "String", into = "String")]
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
#[serde(try_from = "String", into = "String")]
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

        impl From<$code> for String {
            fn from(code: $code) -> Self {
                code.0
            }
        }
    )*};
}

text!(Participant Condition);

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
}
