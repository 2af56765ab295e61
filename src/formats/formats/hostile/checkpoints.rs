//! Hostile checkpoints of torch: zips, pickles and numbers with false contents.

use flate2::Crc;

use super::pickles::noise;
use crate::formats::torch::{Tensor, state_dict};

fn text(text: &str) -> Vec<u8> {
    [b"X", &(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

fn whole(number: i32) -> Vec<u8> {
    [b"J", &number.to_le_bytes()[..]].concat()
}

fn counts(numbers: &[i32]) -> Vec<u8> {
    [b"(".to_vec(), numbers.iter().flat_map(|n| whole(*n)).collect(), b"t".to_vec()].concat()
}

/// A tensor as `torch.save` pickles it.
struct Saved {
    name: &'static str,
    class: &'static str,
    stored: i32,
    offset: i32,
    shape: Vec<i32>,
    strides: Vec<i32>,
}

impl Saved {
    fn pickled(&self, key: usize, is_old: bool) -> Vec<u8> {
        let class = format!("ctorch\n{}\n", self.class);
        let view = if is_old { &b"N"[..] } else { b"" };
        [
            &b"ctorch._utils\n_rebuild_tensor_v2\n(("[..],
            &text("storage"),
            class.as_bytes(),
            &text(&key.to_string()),
            &text("cuda:0"),
            &whole(self.stored),
            view,
            b"tQ",
            &whole(self.offset),
            &counts(&self.shape),
            &counts(&self.strides),
            b"\x89ccollections\nOrderedDict\n)RtR",
        ]
        .concat()
    }
}

/// Two layers: `a` of 2 by 3, and `b`, which is its transposed half.
fn two() -> Vec<Saved> {
    let saved = |name, stored, offset, shape: &[i32], strides: &[i32]| Saved {
        name,
        class: "FloatStorage",
        stored,
        offset,
        shape: shape.to_vec(),
        strides: strides.to_vec(),
    };
    vec![saved("a", 6, 0, &[2, 3], &[3, 1]), saved("b", 6, 1, &[2, 2], &[1, 3])]
}

fn dictionary(saved: &[Saved], is_old: bool) -> Vec<u8> {
    let entries = saved.iter().enumerate().flat_map(|(key, of)| [text(of.name), of.pickled(key, is_old)].concat());
    let entries: Vec<u8> = entries.collect();
    [&b"ccollections\nOrderedDict\n)R("[..], &entries, b"u}", &text("_metadata"), b"}sb"].concat()
}

/// Actor and critic in a pair, as the published weights are.
fn pair(saved: &[Saved]) -> Vec<u8> {
    [b"\x80\x02".to_vec(), dictionary(saved, false), b"}\x86.".to_vec()].concat()
}

fn numbers(from: u16) -> Vec<u8> {
    (from..from + 6).flat_map(|x| f32::from(x).to_le_bytes()).collect()
}

/// An entry: name, bytes, method, flags.
type Entry<'a> = (&'a str, &'a [u8], u16, u16);

fn zipped(entries: &[Entry<'_>]) -> Vec<u8> {
    let (mut out, mut list) = (Vec::new(), Vec::new());
    for (name, bytes, method, flags) in entries {
        let mut crc = Crc::new();
        crc.update(bytes);
        let (at, size) = (out.len() as u32, (bytes.len() as u32).to_le_bytes());
        let middle =
            [&flags.to_le_bytes()[..], &method.to_le_bytes(), &[0; 4], &crc.sum().to_le_bytes(), &size, &size].concat();
        let name_bytes = (name.len() as u16).to_le_bytes();
        out.extend([&b"PK\x03\x04\x14\0"[..], &middle, &name_bytes, &[0, 0], name.as_bytes(), bytes].concat());
        list.extend(
            [&b"PK\x01\x02\x14\0\x14\0"[..], &middle, &name_bytes, &[0; 12], &at.to_le_bytes(), name.as_bytes()]
                .concat(),
        );
    }
    let (at, size, count) = (out.len() as u32, list.len() as u32, entries.len() as u16);
    let end = [
        &b"PK\x05\x06\0\0\0\0"[..],
        &count.to_le_bytes(),
        &count.to_le_bytes(),
        &size.to_le_bytes(),
        &at.to_le_bytes(),
        &[0, 0],
    ];
    [out, list, end.concat()].concat()
}

fn checkpoint_of(pickle: &[u8]) -> Vec<u8> {
    let (a, b) = (numbers(1), numbers(11));
    zipped(&[("archive/data.pkl", pickle, 0, 0), ("archive/data/0", &a, 0, 0), ("archive/data/1", &b, 0, 0)])
}

fn old_of(dictionary: &[u8], little: u8, storages: &[(&str, u64, Vec<u8>)]) -> Vec<u8> {
    let mut out = b"\x80\x02\x8a\x0al\xfc\x9cF\xf9 j\xa8P\x19.\x80\x02M\xe9\x03.\x80\x02}".to_vec();
    out.extend([&text("little_endian")[..], &[little], b"s.\x80\x02", dictionary, b".\x80\x02]("].concat());
    storages.iter().for_each(|(key, ..)| out.extend(text(key)));
    out.extend(b"e.");
    storages.iter().for_each(|(_, count, bytes)| out.extend([&count.to_le_bytes()[..], bytes].concat()));
    out
}

fn old() -> Vec<u8> {
    old_of(&dictionary(&two(), true), 0x88, &[("0", 6, numbers(1)), ("1", 6, numbers(11))])
}

fn read(bytes: &[u8]) -> Vec<Tensor> {
    state_dict("model.pt", bytes, &["actor"]).unwrap_or_else(|error| panic!("{error}"))
}

fn refused(bytes: &[u8]) -> String {
    match state_dict("model.pt", bytes, &["actor"]) {
        Ok(read) => panic!("accepted {read:?}"),
        Err(error) => {
            let parts = [&error.place, &error.expected, &error.remedy];
            assert!(error.file == "model.pt" && parts.iter().all(|text| !text.is_empty()), "{error:?}");
            assert!(error.to_string().len() < 1000, "{error}");
            error.to_string()
        }
    }
}

#[test]
fn both_forms_of_a_checkpoint_hold_their_tensors_wherever_the_dictionary_stands() {
    let tensor = |name: &str, shape: &[usize], values: &[f32]| Tensor {
        name: name.into(),
        shape: shape.to_vec(),
        values: values.to_vec(),
    };
    let wanted =
        [tensor("a", &[2, 3], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), tensor("b", &[2, 2], &[12.0, 15.0, 13.0, 16.0])];
    assert_eq!(read(&checkpoint_of(&pair(&two()))), wanted);
    let below = |key: &str| {
        let dictionary = dictionary(&two(), false);
        [b"\x80\x02}(".to_vec(), text("critic"), b"}".to_vec(), text(key), dictionary, b"u.".to_vec()].concat()
    };
    assert_eq!(read(&checkpoint_of(&below("actor"))), wanted);
    assert_eq!(read(&checkpoint_of(&[b"\x80\x02", &dictionary(&two(), false)[..], b"."].concat())), wanted);
    assert_eq!(read(&old()), wanted);
    assert!(
        refused(&checkpoint_of(&below("agent"))).contains("[\"critic\"]: expected a tensor, found a dictionary of 0")
    );
}

#[test]
fn every_cut_and_many_changes_of_a_checkpoint_are_refused_or_read_and_never_a_panic() {
    for whole in [checkpoint_of(&pair(&two())), old()] {
        for end in 0..whole.len() {
            assert!(!refused(&whole[..end]).is_empty());
        }
        let places = noise(3, 4 * whole.len());
        for (at, value) in (0..whole.len()).cycle().zip(places) {
            let mut changed = whole.clone();
            changed[at] = value;
            let _ = state_dict("model.pt", &changed, &["actor"]);
        }
    }
    assert!(refused(&noise(4, 3000)).contains("torch.save"));
}

#[test]
fn hostile_checkpoints_are_refused_by_place_rule_and_remedy() {
    let plain = pair(&two());
    let with = |change: &dyn Fn(&mut Saved)| {
        let mut saved = two();
        change(&mut saved[0]);
        checkpoint_of(&pair(&saved))
    };
    let pickled = |code: &[u8]| checkpoint_of(&[b"\x80\x02", code, b"."].concat());
    let zip = |entries: &[Entry<'_>]| zipped(&[&[("archive/data.pkl", &plain[..], 0, 0)], entries].concat());
    let (a, b) = (numbers(1), numbers(11));
    let both = [("archive/data/0", &a[..], 0, 0), ("archive/data/1", &b[..], 0, 0)];
    let mut flipped = checkpoint_of(&plain);
    let place = flipped.windows(4).position(|w| w == 6.0_f32.to_le_bytes()).unwrap();
    flipped[place] ^= 1;
    let mut far = checkpoint_of(&plain);
    let at = far.windows(4).position(|w| w == b"PK\x01\x02").unwrap();
    far[at + 42..at + 46].copy_from_slice(&0xffff_fff0_u32.to_le_bytes());
    let mut large = checkpoint_of(&plain);
    large[at + 20..at + 28].copy_from_slice(&[0xf0, 0xff, 0xff, 0x7f, 0xf0, 0xff, 0xff, 0x7f]);
    let broken = dictionary(&two(), true);
    let table: Vec<(&str, Vec<u8>, &str)> = vec![
        ("a name that runs", pickled(b"cos\nsystem\n(X\x02\0\0\0lstR"), "found the name os.system"),
        ("a whole network", pickled(b"ctorch.nn.modules.container\nSequential\n)R"), "state_dict() alone"),
        ("torch.load", pickled(b"ctorch\nload\n)R"), "found the name torch.load"),
        ("a class applied", pickled(b"ctorch\nFloatStorage\n)R"), "found it applied"),
        ("an id of another form", pickled(b"NQ"), "the id of a storage"),
        (
            "a tensor of nothing",
            pickled(b"ctorch._utils\n_rebuild_tensor_v2\n(NNNNtR"),
            "shape and strides of a tensor",
        ),
        ("nested lists", pickled(&b"]".repeat(3_000_000)), "at most 2 million values"),
        ("a list in itself", pickled(b"]q\x00h\x00a"), "a dictionary of tensors"),
        ("no tensors", pickled(b"}"), "a dictionary of tensors, or one under actor"),
        ("other numbers", with(&|of| of.class = "HalfStorage"), "float32 or float64 numbers"),
        ("a count too large", with(&|of| of.stored = 1_000_000), "1000000 numbers of 4 bytes, found 24 bytes"),
        ("a count below zero", with(&|of| of.stored = -1), "the id of a storage"),
        ("a shape too large", with(&|of| of.shape = vec![i32::MAX; 2]), "at most 16000000 numbers"),
        (
            "a shape of many times",
            with(&|of| (of.shape, of.strides) = (vec![9_000, 9_000], vec![0, 0])),
            "at most 16000000",
        ),
        ("steps out of the storage", with(&|of| of.strides = vec![i32::MAX, 1]), "within a storage of 6"),
        ("an offset out of it", with(&|of| of.offset = 1), "within a storage of 6"),
        ("more steps than dimensions", with(&|of| of.strides = vec![1]), "shape and strides of a tensor"),
        ("a compressed entry", zip(&[("archive/data/0", &a, 8, 0), both[1]]), "found a compressed one"),
        ("an encrypted entry", zip(&[("archive/data/0", &a, 0, 1), both[1]]), "found an encrypted one"),
        ("an entry twice", zip(&[both[0], both[0], both[1]]), "each name once"),
        ("no numbers", zip(&both[1..]), "an entry \"archive/data/0\""),
        ("two pickles", zip(&[both[0], both[1], ("other/data.pkl", &plain, 0, 0)]), "one entry FOLDER/data.pkl"),
        ("no pickle", zipped(&both), "one entry FOLDER/data.pkl"),
        ("a big machine", zip(&[both[0], both[1], ("archive/byteorder", b"big", 0, 0)]), "little, found \"big\""),
        ("a flipped bit", flipped, "check sum"),
        ("an entry beyond the file", far, "an entry of a zip file's list"),
        ("a length of 2 GiB", large, "bytes from byte"),
        ("old: a big machine", old_of(&broken, 0x89, &[]), "little_endian"),
        (
            "old: another count",
            old_of(&broken, 0x88, &[("0", 1 << 60, numbers(1))]),
            "6 numbers, found 1152921504606846976",
        ),
        ("old: an unknown key", old_of(&broken, 0x88, &[("7", 6, numbers(1))]), "the key of a storage"),
        ("old: a missing key", old_of(&broken, 0x88, &[("0", 6, numbers(1))]), "the key \"1\""),
        ("old: no numbers", old_of(&broken, 0x88, &[("0", 6, vec![])]), "24 more bytes"),
    ];
    let missed: Vec<String> = table
        .iter()
        .map(|(what, bytes, words)| (what, words, refused(bytes)))
        .filter(|(_, words, refused)| !refused.contains(**words))
        .map(|(what, words, refused)| format!("{what}: no {words:?} in {refused}"))
        .collect();
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}
