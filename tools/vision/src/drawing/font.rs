//! A bitmap font of three by five dots: names, numbers and messages on overlays.

/// The characters of the font. Small letters look like capitals.
const CHARACTERS: &str = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ.,:-+/_=() ";

/// The rows of each character from top to bottom, one octal digit each; the left dot is the highest
/// bit.
const GLYPHS: [u16; 47] = [
    0o75557, 0o26227, 0o71747, 0o71317, 0o55711, 0o74717, 0o74757, 0o71222, 0o75757, 0o75717,
    0o25755, 0o65656, 0o34443, 0o65556, 0o74647, 0o74644, 0o34553, 0o55755, 0o72227, 0o11152,
    0o55655, 0o44447, 0o57755, 0o65555, 0o25552, 0o65644, 0o25563, 0o65655, 0o34216, 0o72222,
    0o55557, 0o55552, 0o55775, 0o55255, 0o55222, 0o71247, 0o00002, 0o00024, 0o02020, 0o00700,
    0o02720, 0o11244, 0o00007, 0o07070, 0o12221, 0o42224, 0o00000,
];

/// A filled box, for a character that is not in the font.
const UNKNOWN: u16 = 0o77777;

/// Columns and rows of the dots of a character.
pub fn dots(character: char) -> impl Iterator<Item = (i64, i64)> {
    let index = CHARACTERS.find(character.to_ascii_uppercase());
    let glyph = index.map_or(UNKNOWN, |index| GLYPHS[index]);
    let cells = (0..5).flat_map(|row| (0..3).map(move |column| (column, row)));
    cells.filter(move |(column, row)| glyph >> (14 - 3 * row - column) & 1 == 1)
}
