//! Hostile pickles: names and opcodes that run code, and one object that is used a million times.

use crate::formats::scenarionet::pickle;
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
        assert!(refused(&[0x80, protocol, b'N', b'.']).contains("protocol 2 to 5"));
    }
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
