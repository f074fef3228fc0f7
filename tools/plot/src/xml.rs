//! Elements of SVG and HTML. Text and attributes are escaped here, so no other place has to think
//! of it.

use std::fmt::{self, Display, Formatter, Write};

use crate::number::coordinate;

/// Elements that stand without an end tag: HTML forbids one for some, and for shapes it is only
/// weight.
const EMPTY: [&str; 9] = [
    "meta", "br", "hr", "col", "path", "rect", "circle", "ellipse", "line",
];

/// An element with its attributes and what it holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Element {
    name: &'static str,
    attributes: Vec<(&'static str, String)>,
    children: Vec<Node>,
}

#[derive(Debug, Clone, PartialEq)]
enum Node {
    Element(Element),
    Text(String),
}

impl Element {
    /// An empty element.
    #[must_use]
    pub const fn new(name: &'static str) -> Self {
        Self {
            name,
            attributes: Vec::new(),
            children: Vec::new(),
        }
    }

    /// With an attribute.
    #[must_use]
    pub fn with(mut self, name: &'static str, value: impl Display) -> Self {
        self.attributes.push((name, value.to_string()));
        self
    }

    /// With an attribute that is a length or place on paper.
    #[must_use]
    pub fn at(self, name: &'static str, value: f64) -> Self {
        self.with(name, coordinate(value))
    }

    /// With text after what it holds already.
    #[must_use]
    pub fn text(mut self, text: impl Into<String>) -> Self {
        self.children.push(Node::Text(text.into()));
        self
    }

    /// With an element after what it holds already.
    #[must_use]
    pub fn child(mut self, child: Self) -> Self {
        self.children.push(Node::Element(child));
        self
    }

    /// With elements after what it holds already.
    #[must_use]
    pub fn children(mut self, children: impl IntoIterator<Item = Self>) -> Self {
        self.children
            .extend(children.into_iter().map(Node::Element));
        self
    }
}

impl Display for Element {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "<{}", self.name)?;
        for (name, value) in &self.attributes {
            write!(f, " {name}=\"{}\"", Escaped(value))?;
        }
        if self.children.is_empty() && EMPTY.contains(&self.name) {
            return f.write_str("/>");
        }
        f.write_char('>')?;
        for child in &self.children {
            match child {
                Node::Element(element) => element.fmt(f)?,
                Node::Text(text) => Escaped(text).fmt(f)?,
            }
        }
        write!(f, "</{}>", self.name)
    }
}

/// Text with the characters replaced that mean something in markup. Control characters, which XML
/// does not allow at all, become the replacement character.
struct Escaped<'a>(&'a str);

impl Display for Escaped<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.0.chars().try_for_each(|c| match c {
            '&' => f.write_str("&amp;"),
            '<' => f.write_str("&lt;"),
            '>' => f.write_str("&gt;"),
            '"' => f.write_str("&quot;"),
            '\'' => f.write_str("&#39;"),
            '\n' | '\t' => f.write_char(c),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => f.write_char('\u{fffd}'),
            c => f.write_char(c),
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn markup_in_text_stays_text() {
        let element = Element::new("p")
            .with("title", "a\"b'<c>")
            .text("<script>alert(1)</script> & more");
        assert_eq!(
            element.to_string(),
            "<p title=\"a&quot;b&#39;&lt;c&gt;\">&lt;script&gt;alert(1)&lt;/script&gt; &amp; more</p>"
        );
    }

    #[test]
    fn only_elements_that_must_stand_without_an_end_tag() {
        assert_eq!(Element::new("td").to_string(), "<td></td>");
        assert_eq!(Element::new("br").to_string(), "<br/>");
        assert_eq!(
            Element::new("path").at("d", 1.0).to_string(),
            "<path d=\"1\"/>"
        );
    }

    proptest! {
        /// Whatever the text, a parser gets it back; what XML cannot carry is replaced.
        #[test]
        fn text_comes_back(text in any::<String>(), value in any::<String>()) {
            let document = Element::new("p").with("title", &value).text(text.clone()).to_string();
            let parsed = roxmltree::Document::parse(&document).unwrap();
            let replaced = |text: &str| -> String {
                let allowed = |c: char| c == '\n' || c == '\t' || !(c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}'));
                text.chars().map(|c| if allowed(c) { c } else { '\u{fffd}' }).collect()
            };
            prop_assert_eq!(parsed.root_element().text().unwrap_or(""), replaced(&text));
            // A parser turns line ends and tabs in attributes into blanks.
            prop_assert_eq!(parsed.root_element().attribute("title").unwrap(), replaced(&value).replace(['\n', '\t'], " "));
        }
    }
}
