//! Writes plain data as a pickle of protocol 4, as Python 3.4 and later read it: dictionaries, lists, texts, numbers, and
//! numpy's arrays in the form in which every version of numpy loads them.

use super::{Node, Numbers, Object, Value};

/// How lists of numbers, and of equally long rows of numbers, are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lists {
    /// As numpy arrays: of booleans where the list holds such, else of 64-bit floats.
    Arrays,
    /// As lists.
    Plain,
}

const PROTOCOL_4: &[u8] = b"\x80\x04";
/// Puts the parts of arrays into the memo and takes them off the stack again: 0 the constructor, 1 the class, 2 and 3
/// the element types.
const ARRAY_PARTS: [&[u8]; 4] = [
    b"cnumpy.core.multiarray\n_reconstruct\n\x940",
    b"cnumpy\nndarray\n\x940",
    b"cnumpy\ndtype\n\x8c\x02f8\x89\x88\x87R(K\x03\x8c\x01<NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb\x940",
    b"cnumpy\ndtype\n\x8c\x02b1\x89\x88\x87R(K\x03\x8c\x01|NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb\x940",
];
const FLOATS: u8 = 2;
const BOOLEANS: u8 = 3;

/// Returns the pickle of a value. Tuples and sets become lists.
pub fn write(root: &Node<'_>, lists: Lists) -> Vec<u8> {
    let mut writer = Writer { out: PROTOCOL_4.to_vec(), lists };
    if lists == Lists::Arrays {
        ARRAY_PARTS.iter().for_each(|part| writer.out.extend_from_slice(part));
    }
    writer.value(root);
    writer.out.push(b'.');
    writer.out
}

struct Writer {
    out: Vec<u8>,
    lists: Lists,
}

impl Writer {
    fn value(&mut self, node: &Node<'_>) {
        match node.value {
            Value::None => self.out.push(b'N'),
            Value::Bool(yes) => self.out.push(if yes { 0x88 } else { 0x89 }),
            Value::Int(number) => self.int(number),
            Value::Float(number) => {
                self.out.push(b'G');
                self.out.extend_from_slice(&number.to_be_bytes());
            }
            Value::Object(_) => match node.pickle.object(node.value) {
                Some(Object::Dict(entries)) => self.dictionary(node, entries),
                Some(Object::List(items) | Object::Tuple(items) | Object::Set(items)) => self.list(node, items),
                _ => match node.text() {
                    Some(text) => self.text(text),
                    None => self.out.push(b'N'),
                },
            },
        }
    }

    fn int(&mut self, number: i64) {
        match i32::try_from(number) {
            Ok(number) => {
                self.out.push(b'J');
                self.out.extend_from_slice(&number.to_le_bytes());
            }
            Err(_) => {
                self.out.extend_from_slice(&[0x8a, 8]);
                self.out.extend_from_slice(&number.to_le_bytes());
            }
        }
    }

    fn text(&mut self, text: &str) {
        self.out.push(0x8d);
        self.out.extend_from_slice(&(text.len() as u64).to_le_bytes());
        self.out.extend_from_slice(text.as_bytes());
    }

    fn dictionary(&mut self, node: &Node<'_>, entries: &[(Value, Value)]) {
        self.out.extend_from_slice(b"}(");
        for (key, value) in entries {
            self.value(&node.of(*key, "key"));
            self.value(&node.of(*value, "value"));
        }
        self.out.push(b'u');
    }

    fn list(&mut self, node: &Node<'_>, items: &[Value]) {
        let first = items.first().filter(|_| self.lists == Lists::Arrays);
        if let (Some(first), Some(table)) = (first, node.numbers()) {
            let has_rows = matches!(first, Value::Object(_));
            return self.array(&table, matches!(first, Value::Bool(_)), has_rows);
        }
        self.out.extend_from_slice(b"](");
        items.iter().for_each(|item| self.value(&node.of(*item, "item")));
        self.out.push(b'e');
    }

    /// Writes the content of numpy's own pickles: an empty array, then its version, shape, element type, order and bytes.
    fn array(&mut self, table: &Numbers<'_>, booleans: bool, has_rows: bool) {
        self.out.extend_from_slice(b"h\x00h\x01K\x00\x85C\x01b\x87R(K\x01");
        self.int(table.rows as i64);
        if has_rows {
            self.int(table.columns as i64);
        }
        self.out.push(if has_rows { 0x86 } else { 0x85 });
        self.out.extend_from_slice(&[b'h', if booleans { BOOLEANS } else { FLOATS }, 0x89]);
        let size = if booleans { 1 } else { 8 };
        self.out.push(0x8e);
        self.out.extend_from_slice(&((table.rows * table.columns * size) as u64).to_le_bytes());
        for (row, column) in (0..table.rows).flat_map(|row| (0..table.columns).map(move |column| (row, column))) {
            if booleans {
                self.out.push(u8::from(table.at(row, column) != 0.0))
            } else {
                self.out.extend_from_slice(&table.at(row, column).to_le_bytes())
            }
        }
        self.out.extend_from_slice(b"tb");
    }
}

#[cfg(test)]
mod tests {
    use super::super::{read, read_json};
    use super::*;

    const PLAIN: &str = r#"{"text \u00e9": "a\nb", "none": null, "yes": true, "small": -7, "large": 5000000000,
        "float": 0.1, "empty": [], "texts": ["a", "b"], "row": [1.5, -0.0, 2], "valid": [true, false],
        "table": [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]], "mixed": [[1.0], [2.0, 3.0]], "inner": {"": {}}}"#;

    #[test]
    fn plain_data_comes_back_and_lists_of_numbers_as_arrays() {
        let tree = read_json("f.json", PLAIN.as_bytes()).unwrap();
        let bytes = write(&tree.root(), Lists::Arrays);
        let pickle = read("f.pkl", &bytes).unwrap();
        let root = pickle.root();
        assert_eq!(root.get("text \u{e9}").unwrap().text(), Some("a\nb"));
        assert!(root.get("none").unwrap().is_none());
        assert_eq!((root.get("small").unwrap().number(), root.get("large").unwrap().number()), (Some(-7.0), Some(5e9)));
        assert_eq!((root.get("yes").unwrap().number(), root.get("float").unwrap().number()), (Some(1.0), Some(0.1)));
        assert_eq!(
            root.get("texts").unwrap().items().unwrap().filter_map(|item| item.text()).collect::<String>(),
            "ab"
        );
        let table = root.get("table").unwrap().numbers().unwrap();
        assert_eq!((table.rows, table.columns, table.at(2, 1)), (3, 2, 6.0));
        assert!(root.get("table").unwrap().described().contains("an array of shape [3, 2]"));
        assert!(root.get("row").unwrap().described().contains("an array of shape [3]"));
        let valid = root.get("valid").unwrap().numbers().unwrap();
        assert_eq!((valid.at(0, 0), valid.at(1, 0)), (1.0, 0.0));
        assert!(root.get("mixed").unwrap().described().contains("a list of 2"));
        assert_eq!(root.get("inner").unwrap().entries().unwrap()[0].0, "");
        let plain = write(&tree.root(), Lists::Plain);
        assert!(!plain.windows(5).any(|window| window == b"numpy"));
        assert!(read("f.pkl", &plain).unwrap().root().get("table").unwrap().described().contains("a list of 3"));
    }
}
