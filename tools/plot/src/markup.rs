//! Elements of SVG and HTML. Text and attributes are escaped here and nowhere else.

use std::fmt::{self, Display, Formatter, Write};

use crate::number::coordinate;

/// Elements without an end tag. HTML forbids it for some; for shapes it only costs bytes.
const WITHOUT_END_TAG: [&str; 7] = ["meta", "br", "path", "rect", "circle", "ellipse", "line"];

/// An element with its attributes and content.
#[derive(Debug, Clone, PartialEq)]
pub struct Element {
    name: &'static str,
    attributes: Vec<(&'static str, String)>,
    content: Vec<Node>,
}

#[derive(Debug, Clone, PartialEq)]
enum Node {
    Element(Element),
    Text(String),
}

impl Element {
    pub const fn new(name: &'static str) -> Self {
        Self { name, attributes: Vec::new(), content: Vec::new() }
    }

    /// A straight line between two points.
    pub fn line([x1, y1]: [f64; 2], [x2, y2]: [f64; 2]) -> Self {
        Self::new("line").lengths([("x1", x1), ("y1", y1), ("x2", x2), ("y2", y2)])
    }

    /// A rectangle from its top left corner.
    pub fn rect([x, y]: [f64; 2], [width, height]: [f64; 2]) -> Self {
        Self::new("rect").lengths([("x", x), ("y", y), ("width", width), ("height", height)])
    }

    /// Adds an attribute.
    pub fn with(mut self, name: &'static str, value: impl Display) -> Self {
        self.attributes.push((name, value.to_string()));
        self
    }

    /// Adds attributes that are lengths or coordinates.
    pub fn lengths<const N: usize>(self, lengths: [(&'static str, f64); N]) -> Self {
        let add = |element: Self, (name, value)| element.with(name, coordinate(value));
        lengths.into_iter().fold(self, add)
    }

    /// Appends text.
    pub fn text(mut self, text: impl Into<String>) -> Self {
        self.content.push(Node::Text(text.into()));
        self
    }

    /// Appends an element.
    pub fn child(self, child: Self) -> Self {
        self.children([child])
    }

    /// Appends elements.
    pub fn children(mut self, children: impl IntoIterator<Item = Self>) -> Self {
        self.content.extend(children.into_iter().map(Node::Element));
        self
    }
}

impl Display for Element {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "<{}", self.name)?;
        for (name, value) in &self.attributes {
            write!(f, " {name}=\"{}\"", Escaped(value))?;
        }
        if self.content.is_empty() && WITHOUT_END_TAG.contains(&self.name) {
            return f.write_str("/>");
        }
        f.write_char('>')?;
        for node in &self.content {
            match node {
                Node::Element(element) => element.fmt(f)?,
                Node::Text(text) => Escaped(text).fmt(f)?,
            }
        }
        write!(f, "</{}>", self.name)
    }
}

/// Text for markup. Control characters, which XML forbids, become the replacement character.
struct Escaped<'a>(&'a str);

impl Display for Escaped<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.0.chars().try_for_each(|c| match c {
            '&' => f.write_str("&amp;"),
            '<' => f.write_str("&lt;"),
            '>' => f.write_str("&gt;"),
            '"' => f.write_str("&quot;"),
            '\'' => f.write_str("&#39;"),
            c if is_allowed(c) => f.write_char(c),
            _ => f.write_char('\u{fffd}'),
        })
    }
}

fn is_allowed(c: char) -> bool {
    matches!(c, '\n' | '\t') || !(c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}'))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn markup_in_text_stays_text() {
        let element = Element::new("p").with("title", "a\"b'<c>").text("<i>1</i> & more");
        let expected = "<p title=\"a&quot;b&#39;&lt;c&gt;\">&lt;i&gt;1&lt;/i&gt; &amp; more</p>";
        assert_eq!(element.to_string(), expected);
    }

    #[test]
    fn only_void_elements_have_no_end_tag() {
        assert_eq!(Element::new("td").to_string(), "<td></td>");
        assert_eq!(Element::new("br").to_string(), "<br/>");
    }

    proptest! {
        #[test]
        fn a_parser_reads_every_text_back(text in any::<String>(), value in any::<String>()) {
            let element = Element::new("p").with("title", &value).text(text.clone());
            let document = element.to_string();
            let parsed = roxmltree::Document::parse(&document).unwrap();
            let root = parsed.root_element();
            let replaced = |text: &str| -> String {
                text.chars().map(|c| if is_allowed(c) { c } else { '\u{fffd}' }).collect()
            };
            prop_assert_eq!(root.text().unwrap_or(""), replaced(&text));
            // A parser turns line ends and tabs in attributes into blanks.
            let value = replaced(&value).replace(['\n', '\t'], " ");
            prop_assert_eq!(root.attribute("title").unwrap(), value);
        }
    }
}
