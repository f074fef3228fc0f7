//! Headings, tables and figures on one page of HTML that needs nothing but itself.

use std::fmt::{self, Display, Formatter};

use crate::figure::Figure;
use crate::xml::Element;

/// How a page looks on a screen and on A4. Nothing in it may need escaping: HTML takes this element
/// as it stands.
const LOOK: &str = "
@page { size: A4; margin: 18mm 17mm; }
* { box-sizing: border-box; }
body { font: 15px/1.5 Helvetica, Arial, Liberation Sans, DejaVu Sans, sans-serif; color: #1a1a1a; background: #ffffff;
  max-width: 47rem; margin: 2rem auto; padding: 0 0.8rem; }
h1 { font-size: 1.55rem; line-height: 1.25; margin: 0 0 0.3rem; }
h2 { font-size: 1.15rem; margin: 2.2rem 0 0.5rem; border-bottom: 1px solid #707070; padding-bottom: 0.15rem; }
p { margin: 0.5rem 0; }
.lead { font-size: 1.05rem; }
figure { margin: 1rem 0 1.4rem; }
svg { display: block; max-width: 100%; height: auto; }
figcaption { font-size: 0.87rem; margin-top: 0.35rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.84rem; margin: 0.8rem 0 1.2rem; min-width: 60%;
  font-variant-numeric: tabular-nums; border-top: 1.5px solid #1a1a1a; border-bottom: 1.5px solid #1a1a1a; }
caption { text-align: left; font-size: 0.87rem; padding-bottom: 0.3rem; }
th, td { padding: 0.16rem 0.55rem; text-align: right; vertical-align: baseline; }
th:first-child, td:first-child { padding-left: 0.2rem; }
thead th { border-bottom: 1px solid #1a1a1a; font-weight: 600; }
.words { text-align: left; }
tbody th { font-weight: 400; text-align: left; white-space: nowrap; }
tr.rule td, tr.rule th { border-top: 1px solid #b4b4b4; }
tr.strong td, tr.strong th { font-weight: 700; }
.facts th { padding-right: 1.2rem; vertical-align: top; }
td { white-space: nowrap; }
td.words { white-space: normal; }
.facts td { text-align: left; white-space: normal; overflow-wrap: anywhere; }
ul { margin: 0.4rem 0; padding-left: 1.3rem; }
.notice { border-left: 4px solid #1a1a1a; background: #f3f3f3; padding: 0.5rem 0.9rem; margin: 1rem 0; }
.notice p { margin: 0.2rem 0; }
footer { margin-top: 2.5rem; font-size: 0.82rem; border-top: 1px solid #b4b4b4; padding-top: 0.5rem; }
@media print {
  html { font-size: 10.5pt; }
  body { font-size: 9.5pt; max-width: none; margin: 0; padding: 0; }
  figure, table, .notice { break-inside: avoid; }
  h2, caption { break-after: avoid; }
  svg { width: 100%; }
  .notice { background: #ffffff; }
}
";

/// What a browser may load: nothing but the look in the page itself.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'";

/// A page. Displays as an HTML document that is well-formed XML, too.
#[derive(Debug)]
pub struct Page {
    title: String,
    body: Vec<Element>,
    figures: usize,
}

impl Page {
    /// A page with a heading.
    #[must_use]
    pub fn new(title: impl Into<String>) -> Self {
        let title = title.into();
        Self {
            body: vec![Element::new("h1").text(&*title)],
            title,
            figures: 0,
        }
    }

    /// Begins a section.
    pub fn section(&mut self, heading: impl Into<String>) {
        self.body.push(Element::new("h2").text(heading));
    }

    /// Adds a paragraph.
    pub fn paragraph(&mut self, words: impl Into<String>) {
        self.body.push(Element::new("p").text(words));
    }

    /// Adds a paragraph that says what matters most.
    pub fn lead(&mut self, words: impl Into<String>) {
        self.body
            .push(Element::new("p").with("class", "lead").text(words));
    }

    /// Adds things to keep in mind, set off from the rest.
    pub fn notice(&mut self, heading: &str, words: impl IntoIterator<Item = String>) {
        let items = words.into_iter().map(|word| Element::new("li").text(word));
        let heading = Element::new("p").child(Element::new("strong").text(heading));
        let list = Element::new("ul").children(items);
        self.body.push(
            Element::new("div")
                .with("class", "notice")
                .with("role", "note")
                .child(heading)
                .child(list),
        );
    }

    /// Adds a figure, numbered, with a caption.
    pub fn figure(&mut self, figure: &Figure, caption: &str) {
        self.figures += 1;
        let number = Element::new("strong").text(format!("Figure {}. ", self.figures));
        let caption = Element::new("figcaption").child(number).text(caption);
        self.body.push(
            Element::new("figure")
                .child(figure.element())
                .child(caption),
        );
    }

    /// Adds a table.
    pub fn table(&mut self, table: &Table) {
        self.body.push(
            Element::new("div")
                .with("class", "wide")
                .child(table.element()),
        );
    }

    /// Adds names with what they stand for.
    pub fn facts(&mut self, facts: impl IntoIterator<Item = (String, String)>) {
        let rows = facts.into_iter().map(|(name, value)| {
            let name = Element::new("th").with("scope", "row").text(name);
            Element::new("tr")
                .child(name)
                .child(Element::new("td").text(value))
        });
        let body = Element::new("tbody").children(rows);
        self.body
            .push(Element::new("table").with("class", "facts").child(body));
    }

    /// Adds what stands below all.
    pub fn footer(&mut self, words: impl Into<String>) {
        self.body.push(Element::new("footer").text(words));
    }
}

impl Display for Page {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let head = Element::new("head")
            .child(Element::new("meta").with("charset", "utf-8"))
            .child(
                Element::new("meta")
                    .with("http-equiv", "Content-Security-Policy")
                    .with("content", POLICY),
            )
            .child(
                Element::new("meta")
                    .with("name", "viewport")
                    .with("content", "width=device-width, initial-scale=1"),
            )
            .child(Element::new("title").text(&*self.title))
            .child(Element::new("style").text(LOOK));
        let main = Element::new("main").children(self.body.iter().cloned());
        let html = Element::new("html")
            .with("lang", "en")
            .child(head)
            .child(Element::new("body").child(main));
        writeln!(f, "<!DOCTYPE html>\n{html}")
    }
}

/// A table of text, numbers to the right.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    caption: String,
    header: Vec<String>,
    rows: Vec<TableRow>,
    /// Columns of text, which begins at the left.
    words: Vec<usize>,
}

/// A row of a table.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TableRow {
    /// What it holds, from left to right; the first names the row.
    pub cells: Vec<String>,
    /// Set in bold.
    pub strong: bool,
    /// With a line above: a new group begins.
    pub rule: bool,
}

impl Table {
    /// An empty table. `header` names the columns.
    #[must_use]
    pub fn new(
        caption: impl Into<String>,
        header: impl IntoIterator<Item = impl Into<String>>,
    ) -> Self {
        Self {
            caption: caption.into(),
            header: header.into_iter().map(Into::into).collect(),
            rows: Vec::new(),
            words: vec![0],
        }
    }

    /// With another column of text: it begins at the left, and its lines may break.
    #[must_use]
    pub fn words(mut self, column: usize) -> Self {
        self.words.push(column);
        self
    }

    /// Adds a row.
    pub fn row(&mut self, row: TableRow) {
        self.rows.push(row);
    }

    fn element(&self) -> Element {
        let column = |(index, name): (usize, &String)| {
            let th = Element::new("th").with("scope", "col").text(&**name);
            if self.words.contains(&index) {
                th.with("class", "words")
            } else {
                th
            }
        };
        let header = Element::new("tr").children(self.header.iter().enumerate().map(column));
        Element::new("table")
            .child(Element::new("caption").text(&*self.caption))
            .child(Element::new("thead").child(header))
            .child(
                Element::new("tbody")
                    .children(self.rows.iter().map(|row| row.element(&self.words))),
            )
    }
}

impl TableRow {
    fn element(&self, words: &[usize]) -> Element {
        let cell = |(index, text): (usize, &String)| match index {
            0 => Element::new("th").with("scope", "row").text(&**text),
            _ if words.contains(&index) => Element::new("td").with("class", "words").text(&**text),
            _ => Element::new("td").text(&**text),
        };
        let classes = [(self.strong, "strong"), (self.rule, "rule")]
            .into_iter()
            .filter_map(|(on, name)| on.then_some(name));
        let classes = classes.collect::<Vec<_>>().join(" ");
        let row = Element::new("tr").children(self.cells.iter().enumerate().map(cell));
        if classes.is_empty() {
            row
        } else {
            row.with("class", classes)
        }
    }
}
