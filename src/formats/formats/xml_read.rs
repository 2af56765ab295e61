//! An XML document as a tree with bounds on size, depth and count. The roxmltree crate reads it, which usvg brings along. It trusts its input:
//! it reserves memory for every `<` and `=`, and compares each attribute and namespace of an element with all others. What would make that
//! endless is refused before it begins. No document type, no entities but the five predefined ones and character references: nothing can expand.

use std::cell::{Cell, OnceCell};
use std::collections::BTreeMap;

use roxmltree::{Error, Node};

use super::import_error::{ImportError, shown};

const BYTES_MAX: usize = 256 << 20;
const DEPTH_MAX: usize = 64;
const ELEMENTS_MAX: usize = 4_000_000;
/// Most `<`: an element has two tags.
const TAGS_MAX: usize = 2 * ELEMENTS_MAX;
const ATTRIBUTES_MAX: usize = 64;
/// Most attributes of all elements together.
const ATTRIBUTES_IN_ALL_MAX: usize = 8_000_000;
/// Most `=` from a tag to the next: some may stand in values and in the text behind it.
const EQUALS_MAX: usize = 2 * ATTRIBUTES_MAX;
/// Most prefixes that are declared: each element with a declaration holds a list of all that hold for it.
const PREFIXES_MAX: usize = 16;
const TEXT_MAX: usize = 4096;
/// Most steps from element to element that a reader may take. Readers search by name, and a hostile file could make
/// each search pass a million other elements.
const STEPS_MAX: usize = 500_000_000;
/// Bytes of a block in which line ends are counted.
const LINES_BLOCK: usize = 4096;

const MEND: &str = "mend the file or fetch it again";
const NO_SCENARIO: &str = "this is not a scenario";

/// A parsed document; [`Document::root`] is the way in.
pub struct Document<'a> {
    source: Source<'a>,
    tree: roxmltree::Document<'a>,
    /// Texts in several pieces, such as around a comment, by the element's number.
    joined: BTreeMap<u32, String>,
    steps: Cell<usize>,
}

/// The file before it is parsed.
struct Source<'a> {
    file: &'a str,
    text: &'a str,
    /// Line ends before each block of the file: a file may have a million faulty elements, each named by its line.
    lines: OnceCell<Vec<usize>>,
}

/// An element of a document.
#[derive(Clone, Copy)]
pub struct Element<'d> {
    document: &'d Document<'d>,
    node: Node<'d, 'd>,
}

impl<'a> Source<'a> {
    fn open(file: &'a str, bytes: &'a [u8]) -> Result<Source<'a>, ImportError> {
        let refuse = |place: String, expected: &str, remedy: &str| Err(ImportError::new(file, place, expected, remedy));
        if bytes.len() > BYTES_MAX {
            return refuse("byte 0".into(), "at most 256 MiB of XML", "split the file");
        }
        match std::str::from_utf8(bytes) {
            Ok(text) => Ok(Source { file, text, lines: OnceCell::new() }),
            Err(error) => refuse(format!("byte {}", error.valid_up_to()), "UTF-8 text", "save it as UTF-8"),
        }
    }

    /// Refuses what the parser would reserve or search without end.
    fn bounded(&self) -> Result<(), ImportError> {
        let (mut at, mut equals) = (0, 0);
        for (tags, tag) in self.text.split('<').enumerate() {
            let own = tag.bytes().filter(|b| *b == b'=').count();
            equals += own;
            if tags > TAGS_MAX {
                return Err(self.at(at, "at most 4 million elements", "split the file"));
            }
            if equals > ATTRIBUTES_IN_ALL_MAX {
                return Err(self.at(at, "at most 8 million attributes", "split the file"));
            }
            if own > EQUALS_MAX && !tag.starts_with(['?', '!']) {
                return Err(self.at(at, "at most 64 attributes of 4096 bytes", NO_SCENARIO));
            }
            at += tag.len() + 1;
        }
        match self.text.match_indices("xmlns:").nth(PREFIXES_MAX) {
            Some((at, _)) => Err(self.at(at, "at most 16 declared prefixes", NO_SCENARIO)),
            None => Ok(()),
        }
    }

    fn refused(&self, error: &Error) -> ImportError {
        let row = error.pos().row as usize;
        let (line, expected, remedy) = match error {
            Error::DtdDetected => {
                let line = self.line(self.text.find("<!DOCTYPE").unwrap_or(0));
                (line, "no document type declaration".into(), "remove <!DOCTYPE ...> from the file")
            }
            Error::UnknownEntityReference(name, _) => {
                let expected = format!("no entity but the predefined ones, found &{};", shown(name));
                (row, expected, "write the text in place of the entity")
            }
            Error::NoRootNode => (row, "a root element".into(), "the file is empty or cut off; fetch it again"),
            Error::UnclosedRootNode | Error::UnexpectedEndOfStream => {
                let expected = "every element closed before the end of the file";
                (self.line(self.text.len()), expected.into(), "the file is cut off; fetch it again")
            }
            Error::UnknownToken(_) => (row, "one root element with elements, texts and comments in it".into(), MEND),
            _ => (row, format!("well-formed XML ({})", shown(&error.to_string())), MEND),
        };
        ImportError::new(self.file, format!("line {line}"), expected, remedy)
    }

    fn at(&self, at: usize, expected: impl Into<String>, remedy: &str) -> ImportError {
        ImportError::new(self.file, format!("line {}", self.line(at)), expected, remedy)
    }

    fn line(&self, at: usize) -> usize {
        let bytes = self.text.as_bytes();
        let ends = |part: &[u8]| part.iter().filter(|&&b| b == b'\n').count();
        let lines = self.lines.get_or_init(|| {
            let before = |sum: &mut usize, block: &[u8]| Some(std::mem::replace(sum, *sum + ends(block)));
            bytes.chunks(LINES_BLOCK).scan(0, before).collect()
        });
        let (at, block) = (at.min(bytes.len()), at / LINES_BLOCK);
        let (from, before) = lines.get(block).map_or((0, 0), |before| (block * LINES_BLOCK, *before));
        1 + before + ends(&bytes[from..at])
    }
}

impl<'a> Document<'a> {
    /// Parses a whole document.
    pub fn parse(file: &'a str, bytes: &'a [u8]) -> Result<Document<'a>, ImportError> {
        let source = Source::open(file, bytes)?;
        source.bounded()?;
        let tree = roxmltree::Document::parse(source.text).map_err(|error| source.refused(&error))?;
        let mut document = Document { source, tree, joined: BTreeMap::new(), steps: Cell::new(0) };
        document.check()?;
        Ok(document)
    }

    /// Checks the bounds that take no time beyond them, and joins texts of several pieces.
    fn check(&mut self) -> Result<(), ImportError> {
        for (count, node) in self.tree.descendants().filter(Node::is_element).enumerate() {
            let refuse = |expected: &str, remedy: &str| Err(self.source.at(node.range().start, expected, remedy));
            if count >= ELEMENTS_MAX {
                return refuse("at most 4 million elements", "split the file");
            }
            // It is its own first ancestor, and the document its last.
            if node.ancestors().nth(DEPTH_MAX + 1).is_some() {
                return refuse("at most 64 nested elements", "this is not a scenario; remove the nesting");
            }
            let mut attributes = node.attributes();
            if attributes.len() > ATTRIBUTES_MAX || attributes.any(|own| own.value().len() > TEXT_MAX) {
                return refuse("at most 64 attributes of 4096 bytes", NO_SCENARIO);
            }
            let (pieces, bytes) = texts(node.children()).fold((0, 0), |(n, sum), text| (n + 1, sum + text.len()));
            if bytes > TEXT_MAX {
                return refuse("at most 4096 bytes of text in an element", NO_SCENARIO);
            }
            if pieces > 1 {
                self.joined.insert(node.id().get(), texts(node.children()).collect());
            }
        }
        Ok(())
    }

    /// The text of the first processing instruction of a target.
    pub fn instruction(&self, target: &str) -> Option<&str> {
        let mut instructions = self.tree.descendants().filter_map(|node| node.pi()).filter(|pi| pi.target == target);
        instructions.next().map(|pi| pi.value.unwrap_or_default().trim())
    }

    /// Call this after reading: it fails if the search budget ran out.
    ///
    /// # Errors The search through the file's elements was given up, so the result is incomplete.
    pub fn was_read_whole(&self) -> Result<(), ImportError> {
        if self.steps.get() <= STEPS_MAX { Ok(()) } else { Err(self.root().refuse("what is searched")) }
    }

    /// The outermost element.
    pub fn root(&self) -> Element<'_> {
        Element { document: self, node: self.tree.root_element() }
    }
}

/// Returns the pieces of text among nodes, trimmed.
fn texts<'d>(nodes: impl Iterator<Item = Node<'d, 'd>>) -> impl Iterator<Item = &'d str> {
    nodes.filter(Node::is_text).filter_map(|node| node.text()).map(str::trim).filter(|text| !text.is_empty())
}

impl<'d> Element<'d> {
    /// The nodes right below it, each counted as a step.
    fn nodes(&self) -> impl Iterator<Item = Node<'d, 'd>> + use<'d> {
        let steps = &self.document.steps;
        let within = move |_: &Node<'_, '_>| {
            steps.set(steps.get() + 1);
            steps.get() <= STEPS_MAX
        };
        self.node.children().take_while(within)
    }

    /// Its name.
    pub fn name(&self) -> &'d str {
        self.node.tag_name().name()
    }

    /// Text between the tags, trimmed.
    pub fn text(&self) -> &'d str {
        let joined = self.document.joined.get(&self.node.id().get());
        joined.map_or_else(|| texts(self.nodes()).next().unwrap_or_default(), String::as_str)
    }

    /// The value of an attribute.
    pub fn attribute(&self, name: &str) -> Option<&'d str> {
        // By their names alone it would find those with a prefix, too.
        let mut own = self.node.attributes().filter(|own| own.namespace().is_none());
        own.find(|own| own.name() == name).map(|own| own.value())
    }

    /// The elements right below it, in order.
    pub fn children(&self) -> impl Iterator<Item = Element<'d>> + use<'d> {
        let document = self.document;
        self.nodes().filter(Node::is_element).map(move |node| Element { document, node })
    }

    /// Those of them that have this name.
    pub fn named(&self, name: &'d str) -> impl Iterator<Item = Element<'d>> + use<'d> {
        self.children().filter(move |child| child.name() == name)
    }

    /// The first of them that has this name.
    pub fn child(&self, name: &str) -> Option<Element<'d>> {
        self.children().find(|child| child.name() == name)
    }

    /// The first child of this name; an error names the element that lacks it.
    pub fn needed_child(&self, name: &str) -> Result<Element<'d>, ImportError> {
        self.child(name).ok_or_else(|| self.refuse(format!("a <{name}> inside")))
    }

    /// The value of an attribute; an error names the element that lacks it.
    pub fn needed_attribute(&self, name: &str) -> Result<&'d str, ImportError> {
        self.attribute(name).ok_or_else(|| self.refuse(format!("an attribute {name:?}")))
    }

    /// The text as a finite number.
    pub fn number(&self) -> Result<f64, ImportError> {
        finite(self.text()).ok_or_else(|| self.refuse(format!("a finite number, found {:?}", shown(self.text()))))
    }

    /// The text as a whole number.
    pub fn integer(&self) -> Result<i64, ImportError> {
        let parsed = self.text().parse().ok();
        parsed.ok_or_else(|| self.refuse(format!("a whole number, found {:?}", shown(self.text()))))
    }

    /// An attribute as a finite number.
    pub fn number_attribute(&self, name: &str) -> Result<f64, ImportError> {
        let text = self.needed_attribute(name)?;
        finite(text).ok_or_else(|| self.refuse(format!("a finite number in {name:?}, found {:?}", shown(text))))
    }

    /// Line and path, such as `line 12, commonRoad/lanelet 7/leftBound`.
    pub fn place(&self) -> String {
        let named = |node| {
            let element = Element { document: self.document, node };
            let id = element.attribute("id").map(|id| format!(" {}", shown(id))).unwrap_or_default();
            format!("{}{id}", shown(element.name()))
        };
        let mut path: Vec<String> = self.node.ancestors().filter(Node::is_element).map(named).collect();
        path.reverse();
        format!("line {}, {}", self.document.source.line(self.node.range().start), path.join("/"))
    }

    /// An error at this element.
    pub fn refuse(&self, expected: impl Into<String>) -> ImportError {
        if self.document.steps.get() > STEPS_MAX {
            let expected = "elements that are found without walking past hundreds of millions of others";
            let remedy = "this is not a scenario; leave it out";
            return ImportError::new(self.document.source.file, self.place(), expected, remedy);
        }
        ImportError::new(self.document.source.file, self.place(), expected, "mend the file or leave it out")
    }
}

fn finite(text: &str) -> Option<f64> {
    text.parse::<f64>().ok().filter(|value| value.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(xml: &str) -> String {
        match Document::parse("f.xml", xml.as_bytes()) {
            Ok(_) => panic!("accepted {xml:.80}"),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn a_document_is_read_with_places() {
        let document =
            Document::parse("f.xml", b"<?xml version='1.0'?>\n<a v='2'>\n<b id='7'> 1.5 </b><b/></a>").unwrap();
        let root = document.root();
        assert_eq!((root.name(), root.attribute("v"), root.children().count()), ("a", Some("2"), 2));
        let b = root.child("b").unwrap();
        assert_eq!(b.number(), Ok(1.5));
        assert_eq!(b.place(), "line 3, a/b 7");
    }

    #[test]
    fn entity_bombs_and_document_types_are_refused() {
        let bomb = r#"<!-- --><!DOCTYPE a [<!ENTITY x "ha"><!ENTITY y "&x;&x;">]><a>&y;</a>"#;
        assert!(refused(bomb).contains("DOCTYPE"));
        assert!(refused(&bomb.replacen("<!DOC", "\n<!DOC", 1)).contains("line 2"));
        assert!(refused("<a>\n&y;</a>").contains("line 2: expected no entity but the predefined ones, found &y;"));
        assert!(refused("<a\nb='&y;'/>").contains("line 2: expected no entity but the predefined ones, found &y;"));
    }

    #[test]
    fn a_text_is_what_stands_between_the_tags_without_the_blanks_around_it() {
        for (xml, text) in [
            ("<a>x&lt;&#65;</a>", "x<A"),
            ("<a> x &amp; y\n</a>", "x & y"),
            ("<a>\n1 <!-- a comment --> 2<b>9</b>\n3</a>", "123"),
            ("<a> <![CDATA[<x>]]> </a>", "<x>"),
            ("<a> <b/> </a>", ""),
        ] {
            assert_eq!(Document::parse("f.xml", xml.as_bytes()).unwrap().root().text(), text, "{xml}");
        }
    }

    #[test]
    fn an_attribute_with_a_prefix_is_another_one() {
        let document = Document::parse("f.xml", b"<p:a xmlns:p='u' p:id='1' id='2'/>").unwrap();
        assert_eq!((document.root().place(), document.root().attribute("p:id")), ("line 1, a 2".into(), None));
    }

    #[test]
    fn cut_nested_and_crossed_documents_are_refused() {
        assert!(refused("<a>\n<b>1</b>").contains("line 2: expected every element closed before the end of the file"));
        assert!(refused("<a>\n<b c='").contains("line 2: expected every element closed before the end of the file"));
        assert!(refused(&format!("{}{}", "<a>".repeat(100_000), "</a>".repeat(100_000))).contains("64 nested"));
        assert!(refused("<a>\n<b></a></b>").contains("line 2: expected well-formed"));
        assert!(refused("").contains("root element"));
        assert!(refused("<a/>\n<a/>").contains("line 2: expected one root"));
        assert!(refused("<a").contains("line 1"));
    }

    /// What the parser would reserve gigabytes for, or search for hours.
    #[test]
    fn what_would_be_endless_is_refused_before_it_begins() {
        let attributes: String = (0..1_000_000).map(|k| format!(" a{k}=''")).collect();
        let prefixes = |k| format!("<a xmlns:n{k}=''>");
        for (xml, reason) in [
            ("\n<".repeat(TAGS_MAX + 2), "line 8000002: expected at most 4 million elements"),
            ("=".repeat(ATTRIBUTES_IN_ALL_MAX + 1), "at most 8 million attributes"),
            (format!("<r>\n<a{attributes}/></r>"), "line 2: expected at most 64 attributes"),
            (format!("<a{}/>", &attributes[..attributes.find(" a64=").unwrap_or(0)]), "accepted"),
            (format!("<a{}/>", &attributes[..attributes.find(" a65=").unwrap_or(0)]), "at most 64 attributes"),
            ((0..10_000).map(prefixes).collect(), "at most 16 declared prefixes"),
            (format!("<r>\n<a>{}</a></r>", "x".repeat(TEXT_MAX + 1)), "line 2: expected at most 4096 bytes of text"),
            (format!("<r>\n<a b='{}'/></r>", "x".repeat(TEXT_MAX + 1)), "line 2: expected at most 64 attributes"),
        ] {
            let read =
                Document::parse("f.xml", xml.as_bytes()).map_or_else(|error| error.to_string(), |_| "accepted".into());
            assert!(read.contains(reason), "{read}, not {reason}: {xml:.80}");
        }
    }

    #[test]
    fn numbers_that_are_none_are_refused() {
        for text in ["NaN", "inf", "-inf", "1e999", "", "1,5"] {
            let xml = format!("<a>{text}</a>");
            let document = Document::parse("f.xml", xml.as_bytes()).unwrap();
            assert!(document.root().number().is_err(), "{text}");
        }
    }
}
