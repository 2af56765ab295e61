//! Hostile pickles: names and opcodes that run code, and one object that is used a million times.

use crate::formats::conventions::Conventions;
use crate::formats::scenarionet::pickle;
use crate::formats::summary::import_file;
use crate::kernel::Seed;

fn refused(bytes: &[u8]) -> String {
    match pickle::read("f.pkl", bytes) {
        Ok(_) => panic!("accepted {bytes:?}"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn every_opcode_that_calls_or_fetches_something_is_refused_by_its_place() {
    // Persistent ids, instances, objects, extensions, new objects with keywords, buffers out of band.
    let calls: [&[u8]; 10] = [
        b"Pid\n",
        b"NQ",
        b"(ios\nsystem\n",
        b"(Ncos\nsystem\no",
        b"\x82\x01",
        b"\x83\x01\x00",
        b"\x84\x01\x00\x00\x00",
        b"N)}\x92",
        b"\x97",
        b"N\x98",
    ];
    for call in calls {
        let refusal = refused(&[b"\x80\x04", call, b"."].concat());
        assert!(refusal.contains("f.pkl: byte ") && refusal.contains("; "), "{refusal}");
        assert!(refusal.contains("an opcode of plain data") || refusal.contains("os.system"), "{call:?}: {refusal}");
    }
    for protocol in [0u8, 1, 6, 255] {
        let refusal = refused(&[0x80, protocol, b'N', b'.']);
        assert!(refusal.contains(&format!("protocol 2 to 5, found protocol {protocol}")), "{refusal}");
    }
}

#[test]
fn old_protocols_and_byte_order_marks_are_said_by_name_and_not_called_damage() {
    // What Python 3 writes of a description, of a class of it, of a defaultdict and of a Counter.
    let heads: [(&[u8], &str); 7] = [
        (b"(dp0\nVa\np1\nI1\ns.", "protocol 0"),
        (
            b"ccopy_reg\n_reconstructor\np0\n(cmetadrive.scenario.scenario_description\nScenarioDescription\n.",
            "protocol 0",
        ),
        (b"ccollections\ndefaultdict\np0\n(c__builtin__\nlong\np1\ntp2\nRp3\n.", "protocol 0"),
        (b"}q\x00X\x01\x00\x00\x00aq\x01K\x01s.", "protocol 1"),
        (b"ccollections\nCounter\nq\x00(}q\x01tq\x02Rq\x03.", "protocol 1"),
        (b"\xef\xbb\xbf\x80\x04}.", "byte order mark"),
        (b"\xff\xfe{\x00}\x00", "byte order mark"),
    ];
    for (bytes, name) in heads {
        let refusal = import_file("f.pkl", bytes, Conventions::default()).unwrap_err().to_string();
        assert!(refusal.contains(name) && !refusal.contains("damaged"), "{name}: {refusal}");
    }
}

/// A dictionary with one entry whose value these opcodes make.
fn holding(value: &[u8]) -> Vec<u8> {
    [b"\x80\x02}X\x01\0\0\0v", value, b"s."].concat()
}

#[test]
fn containers_and_numbers_of_metadata_are_read() {
    let of = |value: &[u8]| -> (Option<f64>, Option<usize>) {
        let bytes = holding(value);
        let pickle = pickle::read("f.pkl", &bytes).unwrap_or_else(|error| panic!("{error}"));
        let node = pickle.root().get("v").unwrap();
        (node.get("a").and_then(|a| a.number()).or(node.number()), node.numbers().map(|table| table.rows))
    };
    for factory in ["int", "float", "str", "bool", "list", "dict", "set", "tuple", "frozenset", "bytes"] {
        let made = format!("ccollections\ndefaultdict\ncbuiltins\n{factory}\n");
        let made = [made.as_bytes(), b"\x85RX\x01\0\0\0aK\x07s"].concat();
        assert_eq!(of(&made).0, Some(7.0), "{factory}");
    }
    assert_eq!(of(b"ccollections\ndefaultdict\nc__builtin__\nlong\n\x85RX\x01\0\0\0aK\x07s").0, Some(7.0));
    assert_eq!(of(b"ccollections\nCounter\n}(X\x01\0\0\0aK\x03u\x85R").0, Some(3.0));
    // Python 3 writes the bytes of a scalar so: protocol 3 and later.
    let scalar = |dtype: &str, state: &[u8], bytes: &[u8]| {
        let dtype =
            [b"cnumpy\ndtype\nX", &(dtype.len() as u32).to_le_bytes()[..], dtype.as_bytes(), b"\x89\x88\x87R"].concat();
        let data = [b"C", &[bytes.len() as u8][..], bytes].concat();
        [b"cnumpy.core.multiarray\nscalar\n", &dtype[..], state, &data, b"\x86R"].concat()
    };
    let plain = b"(K\x03X\x01\0\0\0<NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb";
    // The unit of a time stands behind the rest of its type's state.
    let timed = b"(K\x04X\x01\0\0\0<NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00}(C\x02nsK\x01K\x01K\x01t\x86tb";
    assert_eq!(of(&scalar("f2", plain, &[0x00, 0x3e])).0, Some(1.5));
    assert_eq!(of(&scalar("M8", timed, &1_600_000_000_i64.to_le_bytes())).0, Some(1.6e9));
}

#[test]
fn every_name_that_is_not_data_is_refused_by_name() {
    let names = [
        "os.system",
        "posix.system",
        "nt.system",
        "subprocess.Popen",
        "builtins.eval",
        "builtins.exec",
        "builtins.getattr",
        "builtins.__import__",
        "__builtin__.compile",
        "importlib.import_module",
        "pickle.loads",
        "numpy.load",
        "numpy.core.multiarray._reconstruct.x",
        "functools.partial",
        "operator.attrgetter",
        "codecs.decode",
        "torch.load",
        "numpy.testing._private.utils.runstring",
        "copyreg._reconstructor",
    ];
    for name in names {
        let (module, last) = name.rsplit_once('.').unwrap();
        let plain = format!("c{module}\n{last}\n(X\x02\0\0\0lstR.");
        assert!(refused(&[b"\x80\x02", plain.as_bytes()].concat()).contains(name), "{name}");
        let short = |text: &str| [&[0x8c, text.len() as u8], text.as_bytes()].concat();
        let stacked = [b"\x80\x04".to_vec(), short(module), short(last), b"\x93)R.".to_vec()].concat();
        assert!(refused(&stacked).contains(name), "{name}");
    }
}

#[test]
fn known_names_are_applied_to_nothing_but_their_data() {
    // numpy.dtype of a shape, an array whose state is a text, bytes from a list.
    let calls: [&[u8]; 3] = [
        b"cnumpy\ndtype\n](K\x01e\x85R.",
        b"cnumpy.core.multiarray\n_reconstruct\n)RX\x01\0\0\0xb.",
        b"c_codecs\nencode\n]]\x86R.",
    ];
    for call in calls {
        assert!(refused(&[b"\x80\x02", call].concat()).contains("byte "), "{call:?}");
    }
}

/// `count` tracks of a scene whose ids are one text of `bytes` bytes.
pub fn shared_ids(bytes: usize, count: usize) -> Vec<u8> {
    let text = |text: &str| [b"X", &(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat();
    let mut out = b"\x80\x04}(".to_vec();
    out.extend(text("metadata"));
    out.extend([&b"}("[..], &text("ts"), b"](K\x00K\x01K\x02e", &text("sdc_id"), &text("a"), b"u"].concat());
    out.extend([text("id"), text("s"), text("tracks"), b"}(".to_vec()].concat());
    out.extend([text(&"a".repeat(bytes)), b"\x94}".to_vec()].concat());
    for _ in 1..count {
        out.extend(b"h\x00}");
    }
    out.extend([&b"u"[..], &text("map_features"), b"}u."].concat());
    out
}

/// `count` tracks whose length is one list of `items` numbers.
pub fn shared_sizes(items: usize, count: usize) -> Vec<u8> {
    let text = |text: &str| [b"X", &(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat();
    let list = |inner: &[u8]| [b"](", inner, b"e"].concat();
    let three = list(b"K\x00K\x01K\x02");
    let mut out = b"\x80\x04}(".to_vec();
    out.extend(
        [text("metadata"), b"}(".to_vec(), text("ts"), three.clone(), text("sdc_id"), text("0"), b"u".to_vec()]
            .concat(),
    );
    out.extend([text("id"), text("s"), text("tracks"), b"}(".to_vec()].concat());
    for k in 0..count {
        let size = if k == 0 { [list(&b"K\x01".repeat(items)), b"\x94".to_vec()].concat() } else { b"h\x00".to_vec() };
        let rows = list(&list(b"K\x01K\x02").repeat(3));
        let state = [
            text("position"),
            rows,
            text("heading"),
            three.clone(),
            text("valid"),
            list(b"K\x01K\x01K\x01"),
            text("length"),
            size,
        ];
        out.extend([text(&k.to_string()), b"}(".to_vec(), text("type"), text("VEHICLE"), text("state")].concat());
        out.extend([b"}(".to_vec(), state.concat(), b"uu".to_vec()].concat());
    }
    out.extend([&b"u"[..], &text("map_features"), b"}u."].concat());
    out
}

/// Bytes that mean nothing.
pub fn noise(seed: u64, count: usize) -> Vec<u8> {
    let mut stream = Seed(seed).stream(&["noise"]);
    (0..count).map(|_| stream.uniform(0.0, 256.0) as u8).collect()
}
