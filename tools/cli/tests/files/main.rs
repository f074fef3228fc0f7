//! `i2ris` on files alone: transcripts, next to this folder. Their commands compute without pause,
//! so they are kept apart from emulated drives, whose pseudo-terminals would starve.
#![allow(clippy::unwrap_used)]

use std::{collections::BTreeSet, path::PathBuf};

use i2ris_testing::transcript;

fn folder() -> PathBuf {
    transcript::root().join("tools/cli/tests/transcripts")
}

macro_rules! transcripts {
    ($($name:ident)*) => {
        $(#[test]
        fn $name() {
            transcript::check(&folder().join(stringify!($name)).with_extension("md"));
        })*

        #[test]
        fn every_transcript_is_a_test() {
            let files = std::fs::read_dir(folder()).unwrap();
            let files = files.map(|file| file.unwrap().path().with_extension(""));
            let tests = [$(folder().join(stringify!($name))),*];
            assert_eq!(BTreeSet::from_iter(files), BTreeSet::from(tests));
        }
    };
}

transcripts! { collect configurations drift emulate fit models programs recordings }
