//! Writes XML: elements, escaped attributes and texts, and numbers that every reader accepts. It knows no format.

use std::fmt::{Display, Write};

/// A document that is being written.
pub(super) struct Xml {
    out: String,
    open: Vec<&'static str>,
}

pub(super) type Attribute<'a> = (&'static str, &'a dyn Display);

impl Xml {
    pub fn new() -> Xml {
        Xml { out: "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n".into(), open: Vec::new() }
    }

    pub fn open(&mut self, name: &'static str, attributes: &[Attribute<'_>]) {
        self.tag(name, attributes, ">\n");
        self.open.push(name);
    }

    pub fn close(&mut self) {
        if let Some(name) = self.open.pop() {
            self.indent();
            self.put(format_args!("</{name}>\n"));
        }
    }

    /// An element with others inside.
    pub fn within(&mut self, name: &'static str, attributes: &[Attribute<'_>], inside: impl FnOnce(&mut Xml)) {
        self.open(name, attributes);
        inside(self);
        self.close();
    }

    /// An element with nothing inside.
    pub fn empty(&mut self, name: &'static str, attributes: &[Attribute<'_>]) {
        self.tag(name, attributes, "/>\n");
    }

    /// An element with text.
    pub fn leaf(&mut self, name: &'static str, text: impl Display) {
        self.indent();
        let text = escaped(&text.to_string());
        self.put(format_args!("<{name}>{text}</{name}>\n"));
    }

    /// A processing instruction, which readers ignore that do not know its target. The text must be free of `?>`.
    pub fn instruction(&mut self, target: &'static str, text: &str) {
        self.indent();
        self.put(format_args!("<?{target} {text}?>\n"));
    }

    /// The bytes. Elements that are still open are closed.
    pub fn finish(mut self) -> Vec<u8> {
        while !self.open.is_empty() {
            self.close();
        }
        self.out.into_bytes()
    }

    fn tag(&mut self, name: &str, attributes: &[Attribute<'_>], end: &str) {
        self.indent();
        self.put(format_args!("<{name}"));
        for (key, value) in attributes {
            let value = escaped(&value.to_string());
            self.put(format_args!(" {key}=\"{value}\""));
        }
        self.out.push_str(end);
    }

    fn indent(&mut self) {
        self.out.extend(std::iter::repeat_n("  ", self.open.len()));
    }

    fn put(&mut self, text: std::fmt::Arguments<'_>) {
        if self.out.write_fmt(text).is_err() {
            unreachable!("a text takes whatever is written to it");
        }
    }
}

/// The text escaped for use between tags or quotes. A character that XML 1.0 cannot hold becomes U+FFFD.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&apos;"),
            '\t' | '\n' | '\r' => out.push(' '),
            '\u{0}'..='\u{1f}' | '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// Most digits after the point: libxml2 accepts 24 digits in all.
const DECIMALS_MAX: usize = 18;

/// The shortest decimal text that reads back as the same number, without an exponent; below 1e-18 it is rounded.
pub(super) fn decimal(x: f64) -> String {
    let shortest = format!("{x}");
    let decimals = shortest.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    let mut text = if decimals > DECIMALS_MAX { format!("{x:.DECIMALS_MAX$}") } else { shortest };
    if text.contains('.') {
        text.truncate(text.trim_end_matches('0').trim_end_matches('.').len());
    }
    if text == "-0" { "0".into() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn nothing_breaks_out_of_an_attribute_or_a_text() {
        let mut xml = Xml::new();
        xml.open("a", &[("x", &"\" y='1' <&>\u{0}\n")]);
        xml.leaf("b", "</b>]]>&#0;");
        let text = String::from_utf8(xml.finish()).unwrap();
        assert!(text.contains("x=\"&quot; y=&apos;1&apos; &lt;&amp;&gt;\u{fffd} \""), "{text}");
        assert!(text.contains("<b>&lt;/b&gt;]]&gt;&amp;#0;</b>"), "{text}");
    }

    #[test]
    fn small_numbers_have_no_exponent_and_no_endless_digits() {
        assert_eq!(decimal(-0.0), "0");
        assert_eq!(decimal(-1e-300), "0");
        assert_eq!(decimal(1e-17), "0.00000000000000001");
        assert_eq!(decimal(1.2246467991473532e-16), "0.000000000000000122");
        assert_eq!(decimal(100.0), "100");
    }

    proptest! {
        #[test]
        fn a_number_of_a_scene_reads_back_as_itself(x in -100_000.0f64..100_000.0) {
            prop_assume!(x.abs() > 1e-2);
            prop_assert_eq!(decimal(x).parse::<f64>(), Ok(x));
        }
    }
}
