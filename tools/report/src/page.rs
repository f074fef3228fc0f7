//! Reports: headings, tables and figures on one HTML page without other files.

use std::fmt::{self, Display, Formatter};

use maud::{Markup, PreEscaped, html};

use crate::figure::{Figure, readable};

/// The style sheet for screens and A4 paper.
const STYLE: &str = include_str!("page.css");

/// A browser may load only the style sheet of the page itself. The tags end as in XML, which
/// browsers accept and every parser reads.
const META: &str = r#"<meta charset="utf-8"/><meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'"/><meta name="viewport" content="width=device-width, initial-scale=1"/>"#;

/// A page. Its `Display` is an HTML document that is also well-formed XML.
#[derive(Debug)]
pub struct Page {
    title: String,
    body: Vec<Markup>,
    figures: usize,
}

impl Page {
    /// A page with a heading.
    pub fn new(title: impl Into<String>) -> Self {
        let title = title.into();
        Self { body: vec![html! { h1 { (title) } }], title, figures: 0 }
    }

    /// Begins a section.
    pub fn section(&mut self, heading: impl Into<String>) {
        self.body.push(html! { h2 { (heading.into()) } });
    }

    pub fn paragraph(&mut self, text: impl Into<String>) {
        self.body.push(html! { p { (text.into()) } });
    }

    /// Adds a paragraph with the main result.
    pub fn main_result(&mut self, text: impl Into<String>) {
        self.body.push(html! { p.lead { (text.into()) } });
    }

    /// Adds a box with warnings.
    pub fn notice(&mut self, heading: &str, texts: impl IntoIterator<Item = String>) {
        self.body.push(html! {
            div.notice role="note" {
                p { strong { (heading) } }
                ul { @for text in texts { li { (text) } } }
            }
        });
    }

    /// Adds a figure with a number and a caption.
    pub fn figure(&mut self, figure: &Figure, caption: &str) {
        self.figures += 1;
        self.body.push(html! {
            figure {
                (figure.markup())
                figcaption { strong { "Figure " (self.figures) ". " } (caption) }
            }
        });
    }

    pub fn table(&mut self, table: &Table) {
        self.body.push(html! { div.wide { (table.markup()) } });
    }

    /// Adds a table of names and values.
    pub fn facts(&mut self, facts: impl IntoIterator<Item = (String, String)>) {
        self.body.push(html! {
            table.facts { tbody {
                @for (name, value) in facts { tr { th scope="row" { (name) } td { (value) } } }
            } }
        });
    }

    /// Adds the last line: who wrote the page.
    pub fn footer(&mut self, text: impl Into<String>) {
        self.body.push(html! { footer { (text.into()) } });
    }
}

impl Display for Page {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let page = html! {
            html lang="en" {
                head {
                    (PreEscaped(META))
                    title { (self.title) }
                    style { (PreEscaped(STYLE)) }
                }
                body { main { @for part in &self.body { (part) } } }
            }
        };
        writeln!(f, "<!DOCTYPE html>\n{}", readable(page))
    }
}

/// A table with row names in its first column and numbers, aligned right, in the others.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    caption: String,
    header: Vec<String>,
    rows: Vec<TableRow>,
    /// Columns of text, aligned left.
    text_columns: Vec<usize>,
}

/// A row of a table.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TableRow {
    /// The cells from left to right; the first one is the name of the row.
    pub cells: Vec<String>,
    /// The row is bold.
    pub strong: bool,
    /// A line above the row begins a new group.
    pub rule: bool,
}

impl TableRow {
    /// A row without emphasis.
    pub fn new(cells: impl IntoIterator<Item = String>) -> Self {
        Self { cells: cells.into_iter().collect(), ..Self::default() }
    }

    /// With bold text if `strong` is true.
    pub fn strong(self, strong: bool) -> Self {
        Self { strong, ..self }
    }
}

impl Table {
    /// An empty table. `header` has the names of the columns.
    pub fn new(
        caption: impl Into<String>,
        header: impl IntoIterator<Item = impl Into<String>>,
    ) -> Self {
        Self {
            caption: caption.into(),
            header: header.into_iter().map(Into::into).collect(),
            rows: Vec::new(),
            text_columns: vec![0],
        }
    }

    /// Aligns another column left and lets its lines break.
    pub fn text_column(mut self, column: usize) -> Self {
        self.text_columns.push(column);
        self
    }

    pub fn row(&mut self, row: TableRow) {
        self.rows.push(row);
    }

    fn markup(&self) -> Markup {
        let words = |column: usize| self.text_columns.contains(&column).then_some("words");
        html! {
            table {
                caption { span { (self.caption) } }
                thead { tr {
                    @for (column, name) in self.header.iter().enumerate() {
                        th scope="col" class=[words(column)] { (name) }
                    }
                } }
                tbody { @for row in &self.rows {
                    tr.strong[row.strong].rule[row.rule] {
                        @for (column, text) in row.cells.iter().enumerate() {
                            @if column == 0 { th scope="row" { (text) } }
                            @else { td class=[words(column)] { (text) } }
                        }
                    }
                } }
            }
        }
    }
}
