//! Listings in the manual are the files that they show.

use std::fs;

use super::markdown::root;

#[test]
fn every_listing_is_its_file() {
    let chapter = root().join("tools/manual/src/shared-memory.md");
    let text = fs::read_to_string(&chapter).unwrap();
    let mut listings = 0;
    for part in text.split("<!-- file: ").skip(1) {
        let (name, rest) = part.split_once(" -->\n").unwrap();
        let listing = rest.split_once('\n').unwrap().1.split_once("```").unwrap().0;
        let file = fs::read_to_string(chapter.parent().unwrap().join(name)).unwrap();
        assert!(listing == file, "the listing of {name} differs from the file");
        listings += 1;
    }
    assert_eq!(listings, 2);
}
