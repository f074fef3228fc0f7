//! Plain English: phrases that word order and idiom of German leave in English texts, counted by
//! place. A hit is a question, not an error; the counts only go down.

use std::fs;
use std::path::Path;

use i2ris_testing::sizes::require_at_most;
use regex::Regex;

use super::map::sources;
use super::{ROOT, read};

/// Words without one of which a line has not the phrase, the phrase, and what is not meant by it.
const PHRASES: [(&[&str], &str, &str); 12] = [
    (
        &["there"],
        r"\b(is|are|was|were|be) (not )?there\b",
        r"\b(is|are|was|were|be) (not )?there (is|are|was|were)",
    ),
    (
        &["s no", "e no"],
        r"\b(is|are|was|were) no(ne\b| \w)",
        r"there (is|are|was|were) no|\b(is|are|was|were) no (longer|more|less|other|one\b)",
    ),
    (&["tell", "told", "said", "heard", "asked"], r"\b(tells?|told|said|heard|asked)\b", "^$"),
    (
        &["so many", "so long", "so much", "so few", "so soon", "so often"],
        r"\bso (many|long|much|few|soon|often)\b",
        r"\bso (many|long|much|few|soon|often) (as|that)",
    ),
    (&["//"], r"^\s*//[/!] (What|Of|From|By|Beside|Behind|As) ", "^$"),
    (
        &["of it", "another", "others"],
        r"\bof it\b|\banother one\b|\b(is|are) (another|others)\b",
        "^$",
    ),
    (
        &["anew", "for good", "meanwhile", ", too", "by itself", "by themselves", "in order"],
        r"\b(anew|for good|meanwhile)\b|, too\b|\bby (itself|themselves)\b|\bin order\b",
        r"\bin order (to|of)",
    ),
    (&["beside", "behind"], r"\b(beside|behind)\b", "^$"),
    (
        &["off", "back", "o on", "oes on"],
        concat!(
            r"\b(broken?|breaks?|breaking) (it )?off\b",
            r"|\b(takes?|taken|took) ((it|them) )?(back|off)\b|\bgo(es)? on\b"
        ),
        "^$",
    ),
    (
        &["body", "believ", "mend", "owe", "obey"],
        concat!(
            r"\b([Nn]obody|[Ss]omebody|[Ee]verybody|[Aa]nybody)\b",
            r"|\b(believ\w+|disbelie\w+|mends?|owe[sd]?|obeys?)\b"
        ),
        "^$",
    ),
    (&[", and "], r", and (that|what|not|how|whether|nothing|none)\b", "^$"),
    (&[" of", "balance"], r"\bof (the |a |an )?[a-z]+ of\b|\bbalances? of forces\b", "^$"),
];

struct Phrases(Vec<(&'static [&'static str], Regex, Regex)>);

impl Phrases {
    fn new() -> Self {
        let regex = |text: &str| Regex::new(&format!("(?-u){text}")).unwrap();
        Self(PHRASES.map(|(words, phrase, not)| (words, regex(phrase), regex(not))).to_vec())
    }

    fn hits<'a>(&self, lines: impl Iterator<Item = &'a str>) -> usize {
        let hits = |line: &str| {
            let is_hit = |(words, phrase, not): &&(&[&str], Regex, Regex)| {
                words.iter().any(|word| line.contains(word))
                    && phrase.is_match(line)
                    && phrase.is_match(&not.replace_all(line, ""))
            };
            self.0.iter().filter(is_hit).count()
        };
        lines.map(hits).sum()
    }
}

#[test]
fn texts_use_plain_english() {
    let phrases = Phrases::new();
    let (mut messages, mut comments) = (0, 0);
    for file in sources(Path::new(ROOT)).iter().filter(|it| !it.ends_with("english.rs")) {
        let text = fs::read_to_string(file).unwrap();
        let (comment, code): (Vec<&str>, Vec<&str>) =
            text.lines().partition(|line| line.trim_start().starts_with("//"));
        comments += phrases.hits(comment.into_iter());
        let is_test = file.components().any(|part| part.as_os_str() == "tests");
        messages += if is_test { 0 } else { phrases.hits(code.into_iter()) };
    }
    require_at_most("german_in_comments", comments);
    require_at_most("german_in_messages", messages);
    require_at_most("german_in_readme", phrases.hits(read("README.md").lines()));
    let pages = fs::read_dir(Path::new(ROOT).join("tools/manual/src")).unwrap();
    let pages = pages.map(|page| page.unwrap().path());
    let pages = pages.filter(|page| page.extension().is_some_and(|ending| ending == "md"));
    let manual = pages.map(|page| phrases.hits(fs::read_to_string(page).unwrap().lines())).sum();
    require_at_most("german_in_manual", manual);
}
