//! Reports: headings, tables and figures on one HTML page without other files.

use std::fmt::{self, Display, Formatter};

use crate::figure::Figure;
use crate::markup::Element;

/// The style sheet for screens and A4 paper. HTML does not unescape this element: the sheet must
/// not contain characters that need escaping.
const STYLE: &str = include_str!("page.css");

/// What a browser may load: only the style sheet of the page itself.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'";

/// A page. Its `Display` is an HTML document that is also well-formed XML.
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
        Self { body: vec![Element::new("h1").text(&*title)], title, figures: 0 }
    }

    /// Begins a section.
    pub fn section(&mut self, heading: impl Into<String>) {
        self.body.push(Element::new("h2").text(heading));
    }

    /// Adds a paragraph.
    pub fn paragraph(&mut self, text: impl Into<String>) {
        self.body.push(Element::new("p").text(text));
    }

    /// Adds a paragraph with the main result.
    pub fn main_result(&mut self, text: impl Into<String>) {
        self.body.push(Element::new("p").with("class", "lead").text(text));
    }

    /// Adds a box with warnings.
    pub fn notice(&mut self, heading: &str, texts: impl IntoIterator<Item = String>) {
        let items = texts.into_iter().map(|text| Element::new("li").text(text));
        let heading = Element::new("p").child(Element::new("strong").text(heading));
        let notice = Element::new("div").with("class", "notice").with("role", "note");
        let list = Element::new("ul").children(items);
        self.body.push(notice.child(heading).child(list));
    }

    /// Adds a figure with a number and a caption.
    pub fn figure(&mut self, figure: &Figure, caption: &str) {
        self.figures += 1;
        let number = Element::new("strong").text(format!("Figure {}. ", self.figures));
        let caption = Element::new("figcaption").child(number).text(caption);
        let figure = Element::new("figure").child(figure.element());
        self.body.push(figure.child(caption));
    }

    /// Adds a table.
    pub fn table(&mut self, table: &Table) {
        self.body.push(Element::new("div").with("class", "wide").child(table.element()));
    }

    /// Adds a table of names and values.
    pub fn facts(&mut self, facts: impl IntoIterator<Item = (String, String)>) {
        let rows = facts.into_iter().map(|(name, value)| {
            let name = Element::new("th").with("scope", "row").text(name);
            Element::new("tr").child(name).child(Element::new("td").text(value))
        });
        let body = Element::new("tbody").children(rows);
        self.body.push(Element::new("table").with("class", "facts").child(body));
    }

    /// Adds the last line: who wrote the page.
    pub fn footer(&mut self, text: impl Into<String>) {
        self.body.push(Element::new("footer").text(text));
    }
}

impl Display for Page {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let meta = || Element::new("meta");
        let policy = meta().with("http-equiv", "Content-Security-Policy");
        let viewport = meta().with("name", "viewport");
        let head = Element::new("head")
            .child(meta().with("charset", "utf-8"))
            .child(policy.with("content", POLICY))
            .child(viewport.with("content", "width=device-width, initial-scale=1"))
            .child(Element::new("title").text(&*self.title))
            .child(Element::new("style").text(STYLE));
        let main = Element::new("main").children(self.body.iter().cloned());
        let body = Element::new("body").child(main);
        let html = Element::new("html").with("lang", "en").child(head).child(body);
        writeln!(f, "<!DOCTYPE html>\n{html}")
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
    #[must_use]
    pub fn new(cells: impl IntoIterator<Item = String>) -> Self {
        Self { cells: cells.into_iter().collect(), ..Self::default() }
    }

    /// With bold text if `strong` is true.
    #[must_use]
    pub fn strong(self, strong: bool) -> Self {
        Self { strong, ..self }
    }
}

impl Table {
    /// An empty table. `header` has the names of the columns.
    #[must_use]
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
    #[must_use]
    pub fn text_column(mut self, column: usize) -> Self {
        self.text_columns.push(column);
        self
    }

    /// Adds a row.
    pub fn row(&mut self, row: TableRow) {
        self.rows.push(row);
    }

    fn element(&self) -> Element {
        let header = self.header.iter().enumerate().map(|(column, name)| {
            let cell = Element::new("th").with("scope", "col").text(&**name);
            self.aligned(column, cell)
        });
        let header = Element::new("tr").children(header);
        Element::new("table")
            .child(Element::new("caption").text(&*self.caption))
            .child(Element::new("thead").child(header))
            .child(
                Element::new("tbody").children(self.rows.iter().map(|row| self.row_element(row))),
            )
    }

    fn aligned(&self, column: usize, cell: Element) -> Element {
        match self.text_columns.contains(&column) {
            true => cell.with("class", "words"),
            false => cell,
        }
    }

    fn row_element(&self, row: &TableRow) -> Element {
        let cells = row.cells.iter().enumerate().map(|(column, text)| match column {
            0 => Element::new("th").with("scope", "row").text(&**text),
            _ => self.aligned(column, Element::new("td")).text(&**text),
        });
        let element = Element::new("tr").children(cells);
        match (row.strong, row.rule) {
            (false, false) => element,
            (true, false) => element.with("class", "strong"),
            (false, true) => element.with("class", "rule"),
            (true, true) => element.with("class", "strong rule"),
        }
    }
}
