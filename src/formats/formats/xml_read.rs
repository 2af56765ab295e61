//! An XML document as a flat tree with bounds on size, depth and count. No document type, no entities but the five
//! predefined ones and character references: nothing can expand.

use std::cell::{Cell, OnceCell};

use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};

use super::import_error::{ImportError, shown};

const BYTES_MAX: usize = 256 << 20;
const DEPTH_MAX: usize = 64;
const ELEMENTS_MAX: usize = 4_000_000;
const ATTRIBUTES_MAX: usize = 64;
/// Most attributes of all elements together.
const ATTRIBUTES_IN_ALL_MAX: usize = 8_000_000;
const TEXT_MAX: usize = 4096;
/// Most steps from element to element that a reader may take. Readers search by name, and a hostile file could make
/// each search pass a million other elements.
const STEPS_MAX: usize = 500_000_000;
/// Bytes of a block in which line ends are counted.
const LINES_BLOCK: usize = 4096;
/// Processing instructions that are kept.
const INSTRUCTIONS_MAX: usize = 16;

const NONE: u32 = u32::MAX;

struct Node {
    name: Box<str>,
    attributes: Vec<(Box<str>, Box<str>)>,
    text: String,
    parent: u32,
    first_child: u32,
    last_child: u32,
    next_sibling: u32,
    /// Byte at which the element begins.
    at: usize,
}

/// A parsed document; [`Document::root`] is the way in.
pub struct Document<'a> {
    file: &'a str,
    source: &'a str,
    nodes: Vec<Node>,
    /// Target and text.
    instructions: Vec<(String, String)>,
    attributes: usize,
    steps: Cell<usize>,
    /// Line ends before each block of the file: a file may have a million faulty elements, each named by its line.
    lines: OnceCell<Vec<usize>>,
}

/// An element of a document.
#[derive(Clone, Copy)]
pub struct Element<'d> {
    document: &'d Document<'d>,
    index: usize,
}

impl<'a> Document<'a> {
    /// Parses a whole document.
    pub fn parse(file: &'a str, bytes: &'a [u8]) -> Result<Document<'a>, ImportError> {
        let refuse = |place: String, expected: &str, remedy: &str| Err(ImportError::new(file, place, expected, remedy));
        if bytes.len() > BYTES_MAX {
            return refuse("byte 0".into(), "at most 256 MiB of XML", "split the file");
        }
        let source = match std::str::from_utf8(bytes) {
            Ok(source) => source.strip_prefix('\u{feff}').unwrap_or(source),
            Err(error) => return refuse(format!("byte {}", error.valid_up_to()), "UTF-8 text", "save it as UTF-8"),
        };
        let mut document = Document {
            file,
            source,
            nodes: Vec::new(),
            instructions: Vec::new(),
            attributes: 0,
            steps: Cell::new(0),
            lines: OnceCell::new(),
        };
        document.read()?;
        Ok(document)
    }

    fn read(&mut self) -> Result<(), ImportError> {
        let mut reader = Reader::from_str(self.source);
        let mut open: Vec<u32> = Vec::new();
        loop {
            let at = usize::try_from(reader.buffer_position()).unwrap_or(usize::MAX);
            let event = reader.read_event().map_err(|error| {
                let at = usize::try_from(reader.error_position()).unwrap_or(at);
                self.at(at, format!("well-formed XML ({error})"), "mend the file or fetch it again")
            })?;
            match event {
                Event::Start(tag) => {
                    let node = self.add(&tag, at, &open)?;
                    open.push(node);
                }
                Event::Empty(tag) => {
                    self.add(&tag, at, &open)?;
                }
                Event::End(_) => {
                    open.pop();
                }
                Event::Text(text) => self.text(&open, at, &text.xml10_content())?,
                Event::CData(text) => self.text(&open, at, &text.xml10_content())?,
                Event::GeneralRef(entity) => {
                    let name = entity.xml10_content();
                    let resolved = match entity.resolve_char_ref() {
                        Ok(Some(c)) => Some(c.to_string()),
                        _ => quick_xml::escape::resolve_xml_entity(&name).map(str::to_string),
                    };
                    let expected = format!("no entity but the predefined ones, found &{};", shown(&name));
                    let text =
                        resolved.ok_or_else(|| self.at(at, expected, "write the text in place of the entity"))?;
                    self.text(&open, at, &text)?;
                }
                Event::DocType(_) => {
                    return Err(self.at(at, "no document type declaration", "remove <!DOCTYPE ...> from the file"));
                }
                Event::PI(instruction) if self.instructions.len() < INSTRUCTIONS_MAX => {
                    let (target, text) = (instruction.target().to_string(), instruction.content().trim().to_string());
                    self.instructions.push((target, text));
                }
                Event::Decl(_) | Event::PI(_) | Event::Comment(_) => {}
                Event::Eof => break,
            }
        }
        if let Some(&last) = open.last() {
            let name = &self.nodes[last as usize].name;
            let expected = format!("</{}> before the end of the file", shown(name));
            return Err(self.at(self.source.len(), expected, "the file is cut off; fetch it again"));
        }
        if self.nodes.is_empty() {
            return Err(self.at(0, "a root element", "the file is empty; fetch it again"));
        }
        Ok(())
    }

    fn add(&mut self, tag: &BytesStart<'_>, at: usize, open: &[u32]) -> Result<u32, ImportError> {
        if open.len() >= DEPTH_MAX {
            return Err(self.at(at, "at most 64 nested elements", "this is not a scenario; remove the nesting"));
        }
        if self.nodes.len() >= ELEMENTS_MAX {
            return Err(self.at(at, "at most 4 million elements", "split the file"));
        }
        if open.is_empty() && !self.nodes.is_empty() {
            return Err(self.at(at, "one root element", "remove what stands after it"));
        }
        let index = self.nodes.len() as u32;
        let mut attributes = Vec::new();
        for attribute in tag.attributes() {
            let attribute = attribute.map_err(|e| self.at(at, format!("attributes ({e})"), "mend the file"))?;
            let value = attribute
                .normalized_value(XmlVersion::Implicit1_0)
                .map_err(|e| self.at(at, format!("an attribute without entities ({e})"), "mend the file"))?;
            if attributes.len() >= ATTRIBUTES_MAX || value.len() > TEXT_MAX {
                return Err(self.at(at, "at most 64 attributes of 4096 bytes", "this is not a scenario"));
            }
            self.attributes += 1;
            if self.attributes > ATTRIBUTES_IN_ALL_MAX {
                return Err(self.at(at, "at most 8 million attributes", "split the file"));
            }
            attributes.push((attribute.key.as_ref().into(), value.as_ref().into()));
        }
        let parent = open.last().copied().unwrap_or(NONE);
        self.nodes.push(Node {
            name: tag.local_name().as_ref().into(),
            attributes,
            text: String::new(),
            parent,
            first_child: NONE,
            last_child: NONE,
            next_sibling: NONE,
            at,
        });
        if parent != NONE {
            let before = std::mem::replace(&mut self.nodes[parent as usize].last_child, index);
            match before {
                NONE => self.nodes[parent as usize].first_child = index,
                before => self.nodes[before as usize].next_sibling = index,
            }
        }
        Ok(index)
    }

    fn text(&mut self, open: &[u32], at: usize, text: &str) -> Result<(), ImportError> {
        let Some(&node) = open.last() else { return Ok(()) };
        let text = text.trim();
        let held = &mut self.nodes[node as usize].text;
        if held.len() + text.len() > TEXT_MAX {
            return Err(self.at(at, "at most 4096 bytes of text in an element", "this is not a scenario"));
        }
        held.push_str(text);
        Ok(())
    }

    fn at(&self, at: usize, expected: impl Into<String>, remedy: &str) -> ImportError {
        ImportError::new(self.file, format!("line {}", self.line(at)), expected, remedy)
    }

    fn line(&self, at: usize) -> usize {
        let bytes = self.source.as_bytes();
        let ends = |part: &[u8]| part.iter().filter(|&&b| b == b'\n').count();
        let lines = self.lines.get_or_init(|| {
            let before = |sum: &mut usize, block: &[u8]| Some(std::mem::replace(sum, *sum + ends(block)));
            bytes.chunks(LINES_BLOCK).scan(0, before).collect()
        });
        let (at, block) = (at.min(bytes.len()), at / LINES_BLOCK);
        let (from, before) = lines.get(block).map_or((0, 0), |before| (block * LINES_BLOCK, *before));
        1 + before + ends(&bytes[from..at])
    }

    /// The text of the first processing instruction of a target.
    pub fn instruction(&self, target: &str) -> Option<&str> {
        self.instructions.iter().find(|(name, _)| name == target).map(|(_, text)| text.as_str())
    }

    /// Call this after reading: it fails if the search budget ran out.
    ///
    /// # Errors The search through the file's elements was given up, so the result is incomplete.
    pub fn was_read_whole(&self) -> Result<(), ImportError> {
        if self.steps.get() <= STEPS_MAX { Ok(()) } else { Err(self.root().refuse("what is searched")) }
    }

    /// The outermost element.
    pub fn root(&self) -> Element<'_> {
        Element { document: self, index: 0 }
    }
}

impl<'d> Element<'d> {
    fn node(&self) -> &'d Node {
        &self.document.nodes[self.index]
    }

    /// Its name.
    pub fn name(&self) -> &'d str {
        &self.node().name
    }

    /// Text between the tags, trimmed.
    pub fn text(&self) -> &'d str {
        &self.node().text
    }

    /// The value of an attribute.
    pub fn attribute(&self, name: &str) -> Option<&'d str> {
        self.node().attributes.iter().find(|(key, _)| &**key == name).map(|(_, value)| &**value)
    }

    /// The elements right below it, in order.
    pub fn children(&self) -> impl Iterator<Item = Element<'d>> + use<'d> {
        let document = self.document;
        let mut next = self.node().first_child;
        std::iter::from_fn(move || {
            let index = (next != NONE).then_some(next as usize)?;
            document.steps.set(document.steps.get() + 1);
            if document.steps.get() > STEPS_MAX {
                return None;
            }
            next = document.nodes[index].next_sibling;
            Some(Element { document, index })
        })
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
        let mut path = Vec::new();
        let mut index = self.index as u32;
        while index != NONE {
            let element = Element { document: self.document, index: index as usize };
            let id = element.attribute("id").map(|id| format!(" {}", shown(id))).unwrap_or_default();
            path.push(format!("{}{id}", shown(element.name())));
            index = element.node().parent;
        }
        path.reverse();
        format!("line {}, {}", self.document.line(self.node().at), path.join("/"))
    }

    /// An error at this element.
    pub fn refuse(&self, expected: impl Into<String>) -> ImportError {
        if self.document.steps.get() > STEPS_MAX {
            let expected = "elements that are found without walking past hundreds of millions of others";
            return ImportError::new(
                self.document.file,
                self.place(),
                expected,
                "this is not a scenario; leave it out",
            );
        }
        ImportError::new(self.document.file, self.place(), expected, "mend the file or leave it out")
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
        let bomb = r#"<!DOCTYPE a [<!ENTITY x "ha"><!ENTITY y "&x;&x;">]><a>&y;</a>"#;
        assert!(refused(bomb).contains("DOCTYPE"));
        assert!(refused("<a>&y;</a>").contains("&y;"));
        assert!(refused("<a b='&y;'/>").contains("entities"));
    }

    #[test]
    fn predefined_entities_are_text() {
        let document = Document::parse("f.xml", b"<a>x&lt;&#65;</a>").unwrap();
        assert_eq!(document.root().text(), "x<A");
    }

    #[test]
    fn cut_nested_and_crossed_documents_are_refused() {
        assert!(refused("<a><b>1</b>").contains("cut off"));
        assert!(refused(&"<a>".repeat(100_000)).contains("64 nested"));
        assert!(refused("<a><b></a></b>").contains("well-formed"));
        assert!(refused("").contains("root element"));
        assert!(refused("<a/><a/>").contains("one root"));
        assert!(refused("<a").contains("line 1"));
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
