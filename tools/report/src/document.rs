//! A report, written once: headings, sentences, facts, tables and figures, as text for a terminal
//! and as one HTML page without other files.

use std::iter;

use maud::{Markup, PreEscaped, html};

use crate::figure::{Figure, readable};

const STYLE: &str = include_str!("document.css");

/// Only the style sheet of the page may be loaded. The tags end as in XML, for every parser.
const META: &str = concat!(
    r#"<meta charset="utf-8"/><meta http-equiv="Content-Security-Policy" "#,
    r#"content="default-src 'none'; style-src 'unsafe-inline'"/>"#,
    r#"<meta name="viewport" content="width=device-width, initial-scale=1"/>"#
);

/// Minimum width of the names in a list of facts.
const NAME_WIDTH: usize = 10;

/// A report. It has no fonts, no scripts and no network.
#[derive(Debug)]
pub struct Document {
    title: String,
    parts: Vec<Part>,
    /// Which parts a text leaves out.
    page_only: Vec<usize>,
}

#[derive(Debug)]
enum Part {
    MainResult(String),
    Section(String),
    Paragraph(String),
    Notice(String, Vec<String>),
    Facts(Vec<(String, String)>),
    Table(Table),
    Figure(Box<Figure>, String),
    Footer(String),
}

impl Document {
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), parts: Vec::new(), page_only: Vec::new() }
    }

    pub fn section(&mut self, heading: impl Into<String>) {
        self.parts.push(Part::Section(heading.into()));
    }

    pub fn paragraph(&mut self, text: impl Into<String>) {
        self.parts.push(Part::Paragraph(text.into()));
    }

    pub fn main_result(&mut self, text: impl Into<String>) {
        self.parts.push(Part::MainResult(text.into()));
    }

    /// Adds warnings, in a box with a heading; nothing without any.
    pub fn notice(&mut self, heading: &str, texts: impl IntoIterator<Item = String>) {
        let texts: Vec<String> = texts.into_iter().collect();
        if !texts.is_empty() {
            self.parts.push(Part::Notice(heading.to_owned(), texts));
        }
    }

    /// Adds a figure with a number and a caption. A text leaves it out.
    pub fn figure(&mut self, figure: Figure, caption: impl Into<String>) {
        self.parts.push(Part::Figure(Box::new(figure), caption.into()));
    }

    /// Adds a table; nothing for one without rows.
    pub fn table(&mut self, table: Table) {
        if !table.rows.is_empty() {
            self.parts.push(Part::Table(table));
        }
    }

    /// Adds names and values; nothing without any. A value may have several lines.
    pub fn facts<N: Into<String>>(&mut self, facts: impl IntoIterator<Item = (N, String)>) {
        let facts = facts.into_iter().map(|(name, value)| (name.into(), value));
        let facts: Vec<_> = facts.collect();
        if !facts.is_empty() {
            self.parts.push(Part::Facts(facts));
        }
    }

    /// Adds the last line of a page: who wrote it.
    pub fn footer(&mut self, text: impl Into<String>) {
        self.parts.push(Part::Footer(text.into()));
    }

    /// Adds parts that a text leaves out.
    pub fn page_only(&mut self, write: impl FnOnce(&mut Self)) {
        let first = self.parts.len();
        write(self);
        self.page_only.extend(first..self.parts.len());
    }

    /// An HTML document that is also well-formed XML.
    pub fn html(&self) -> String {
        let mut figures = 0;
        let page = html! {
            html lang="en" {
                head {
                    (PreEscaped(META))
                    title { (self.title) }
                    style { (PreEscaped(STYLE)) }
                }
                body { main {
                    h1 { (self.title) }
                    @for part in &self.parts { (part.markup(&mut figures)) }
                } }
            }
        };
        format!("<!DOCTYPE html>\n{}\n", readable(page))
    }

    /// Lines of at most `width` columns, if their words and tables allow it; without figures.
    pub fn text(&self, width: usize) -> String {
        let mut text = wrapped("", &self.title, width);
        for (index, part) in self.parts.iter().enumerate() {
            if !self.page_only.contains(&index) {
                text += &part.text(width);
            }
        }
        text
    }
}

impl Part {
    fn markup(&self, figures: &mut usize) -> Markup {
        match self {
            Self::MainResult(text) => html! { p.lead { (text) } },
            Self::Section(heading) => html! { h2 { (heading) } },
            Self::Paragraph(text) => html! { p { (text) } },
            Self::Notice(heading, texts) => html! {
                div.notice role="note" {
                    p { strong { (heading) } }
                    ul { @for text in texts { li { (sentence(text)) } } }
                }
            },
            Self::Facts(facts) => html! {
                table.facts { tbody { @for (name, value) in facts {
                    tr { th scope="row" { (name) } td { (value) } }
                } } }
            },
            Self::Table(table) => html! { div.wide { (table.markup()) } },
            Self::Figure(figure, caption) => {
                *figures += 1;
                html! { figure {
                    (figure.markup())
                    figcaption { strong { "Figure " (figures) ". " } (caption) }
                } }
            }
            Self::Footer(text) => html! { footer { (text) } },
        }
    }

    fn text(&self, width: usize) -> String {
        match self {
            Self::MainResult(text) | Self::Paragraph(text) => wrapped("", text, width),
            Self::Section(heading) => format!("\n{heading}\n"),
            Self::Notice(_, texts) => {
                let name = format!("{:<NAME_WIDTH$} ", "warning");
                texts.iter().map(|text| wrapped(&name, text, width)).collect()
            }
            Self::Facts(facts) => {
                let widths = facts.iter().map(|(name, _)| name.chars().count());
                let name_width = widths.fold(NAME_WIDTH, usize::max);
                let fact = |(name, value): &(String, String)| {
                    wrapped(&format!("{name:<name_width$} "), value, width)
                };
                facts.iter().map(fact).collect()
            }
            Self::Table(table) => table.text(width),
            Self::Figure(..) | Self::Footer(_) => String::new(),
        }
    }
}

/// With a capital letter at the beginning and a full stop at the end.
fn sentence(words: &str) -> String {
    let mut characters = words.chars();
    let first = characters.next().map(|first| first.to_uppercase().to_string()).unwrap_or_default();
    format!("{first}{}.", characters.as_str().trim_end_matches('.'))
}

/// Text after a name, in lines of at most `width` columns, all of them in the column of the first.
fn wrapped(name: &str, text: &str, width: usize) -> String {
    let indent = name.chars().count();
    let (mut lines, mut before) = (String::new(), name.to_owned());
    for line in text.lines() {
        let mut column = 0;
        for word in line.split(' ') {
            let length = word.chars().count();
            if column > indent && column + 1 + length > width {
                lines.push('\n');
                (before, column) = (" ".repeat(indent), 0);
            }
            lines += &before;
            lines += word;
            column += before.chars().count() + length;
            " ".clone_into(&mut before);
        }
        lines.push('\n');
        before = " ".repeat(indent);
    }
    lines
}

/// A table with row names in its first column and numbers, aligned right, in the others.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    caption: String,
    header: Vec<String>,
    rows: Vec<Row>,
    /// Columns of text, aligned left.
    text_columns: Vec<usize>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The cells from left to right; the first one is the name of the row.
    cells: Vec<String>,
    /// The row is bold, in a text marked with a star.
    pub strong: bool,
    /// A line above the row begins a new group.
    pub rule: bool,
}

impl Table {
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

    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) -> &mut Row {
        let cells = cells.into_iter().collect();
        self.rows.push(Row { cells, strong: false, rule: false });
        let last = self.rows.len() - 1;
        &mut self.rows[last]
    }

    /// Columns as wide as their cells.
    fn text(&self, width: usize) -> String {
        let rows = || iter::once(&self.header).chain(self.rows.iter().map(|row| &row.cells));
        let cell_width = |cell: &String| cell.chars().count();
        let column_width =
            |column: usize| rows().filter_map(|row| row.get(column)).map(cell_width).max();
        let widths: Vec<_> =
            (0..self.header.len()).map(|at| column_width(at).unwrap_or(0)).collect();
        let line = |(cells, mark): (&Vec<String>, &str)| {
            let mut line = String::new();
            for (column, (cell, width)) in cells.iter().zip(&widths).enumerate() {
                line += &match self.text_columns.contains(&column) {
                    true => format!("{}{cell:<width$}", if column > 0 { " " } else { "" }),
                    false => format!("  {cell:>width$}"),
                };
            }
            format!("{}{mark}\n", line.trim_end())
        };
        let marks = self.rows.iter().map(|row| if row.strong { " *" } else { "" });
        let lines = rows().zip(iter::once("").chain(marks)).map(line);
        iter::once(format!("\n{}", wrapped("", &self.caption, width))).chain(lines).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_has_aligned_columns_and_lines_of_its_width() {
        let mut document = Document::new("A title");
        document.main_result("one two three four five");
        document.notice("Note", ["the camera moved".to_owned()]);
        document.facts([("rows", "1, 2, 3, 4, 5, 6, 7\nand 8".to_owned())]);
        let mut table = Table::new("What was found.", ["", "kind", "size"]).text_column(1);
        table.row(["a", "x", "1.25"].map(str::to_owned));
        table.row(["long", "y", "10"].map(str::to_owned)).strong = true;
        document.table(table);
        document.page_only(|page| page.paragraph("much more"));
        let expected = [
            "A title",
            "one two three four",
            "five",
            "warning    the",
            "           camera",
            "           moved",
            "rows       1, 2,",
            "           3, 4,",
            "           5, 6, 7",
            "           and 8",
            "",
            "What was found.",
            "     kind  size",
            "a    x     1.25",
            "long y       10 *",
            "",
        ];
        assert_eq!(document.text(18), expected.join("\n"));
        let page = document.html();
        assert!(page.contains("<li>The camera moved.</li>") && page.contains("much more"));
    }
}
