//! A pool: the scenes of a study in one file, with a manifest and a checksum, and how it is split. The format is
//! described in docs/FORMAT.md; reading and writing the bytes is the store's.
//!
//! A `*.pool` file, little-endian: `EVODPOOL`, version (u32), length of the manifest (u64), the manifest as JSON
//! ([`Manifest`]), the scenes' bodies one after another in the manifest's order (see `binary.rs`), and the BLAKE3
//! digest (32 bytes) of everything before it.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::binary::{scene_bytes, scene_digest_of, scene_of};
use super::usable::usable;
use super::{Origin, Scene};
use crate::kernel::{Digest, Seed};

/// First bytes of every pool file.
const MAGIC: &[u8; 8] = b"EVODPOOL";
/// Rises when an older reader could not read what is written.
const VERSION: u32 = 1;
/// Magic, version, length of the manifest.
const HEAD_BYTES: usize = 8 + 4 + 8;
const CHECKSUM_BYTES: usize = 32;

/// A file, or a part of it, that is not in the pool, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeftOut {
    /// File name without folder.
    pub file: String,
    /// The scene, obstacle or element within it; empty for the whole file.
    pub what: String,
    /// A plain sentence.
    pub reason: String,
}

impl LeftOut {
    /// `what` of a file whose sample times do not fit the grid of 0.1 s.
    pub const SAMPLE_TIMES: &str = "its sample times";
    /// `what` of a file without velocities: they come from its places.
    pub const VELOCITIES: &str = "its velocities";
    /// `what` of a file without headings: they come from its motion.
    pub const HEADINGS: &str = "its headings";
    /// `what` of a file with kinds of road users that nobody knows: their motion says what they are.
    pub const KINDS: &str = "its kinds";
    /// `what` of a file whose id is missing, or is that of another scene.
    pub const SCENE_ID: &str = "its id";
    /// `what` of a file without heights: everybody is on one level.
    pub const HEIGHTS: &str = "its heights";
    /// `what` of a file with vehicles that are wider than long: their sides are exchanged.
    pub const SIZES: &str = "its sizes";
    /// `what` of a file whose headings contradict the motion, in no convention that is known: they are kept as they are.
    pub const HEADINGS_DOUBTFUL: &str = "its headings as written";
    /// `what` of a file whose velocities are steadily faster or slower than the motion: they are kept as they are.
    pub const VELOCITIES_DOUBTFUL: &str = "its velocities as written";
    const KEPT: [&str; 7] =
        [Self::SAMPLE_TIMES, Self::VELOCITIES, Self::HEADINGS, Self::KINDS, Self::HEIGHTS, Self::SCENE_ID, Self::SIZES];

    /// Returns `true` if the part is in the pool and only differs from the file's: resampled motion is changed, not missing.
    pub fn is_kept(&self) -> bool {
        self.is_doubtful() || Self::KEPT.contains(&self.what.as_str())
    }

    /// Returns `true` if the part is in the pool as the file has it, and likely wrong.
    pub fn is_doubtful(&self) -> bool {
        [Self::HEADINGS_DOUBTFUL, Self::VELOCITIES_DOUBTFUL].contains(&self.what.as_str())
    }
}

/// Scenes with unique ids, and what was left out when they were imported.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pool {
    /// The scenes; ids are unique.
    pub scenes: Vec<Scene>,
    /// Parts that were left out at import, with their reasons.
    pub left_out: Vec<LeftOut>,
    /// True if runs seal the origins of the scenes and the parts left out. Pools that are generated, and those that were imported by
    /// earlier releases, have false: the roots of their runs stay what they were.
    pub seals_provenance: bool,
}

/// One scene in a pool's manifest.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ManifestEntry {
    /// Id of the scene.
    pub id: String,
    /// Digest of its content.
    pub digest: Digest,
    /// Origin of the scene.
    pub origin: Origin,
    /// Its samples.
    pub steps: usize,
    /// Its tracks, the ego not counted.
    pub tracks: usize,
    /// Its lanes.
    pub lanes: usize,
    /// Why it is not used for evolution; `None` for a usable scene.
    pub unusable: Option<String>,
    /// Length of the scene's body, bytes.
    pub bytes: usize,
}

/// Head of a pool file, as JSON.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// One entry per scene, in the pool's order.
    pub scenes: Vec<ManifestEntry>,
    /// Parts that were left out at import, with their reasons.
    pub left_out: Vec<LeftOut>,
    /// Digest of both, where runs on the pool seal it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Digest>,
}

/// Why a pool file cannot be read, or a pool cannot be split as asked.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PoolError {
    /// The bytes do not begin as a pool file does.
    #[error("{file} is not a scene pool: expected {expected}; make one with `evodrive scenes import`")]
    NotAPool {
        /// Name of the file.
        file: String,
        /// Bytes that were expected there.
        expected: &'static str,
    },
    /// Another version of the format wrote the file.
    #[error("{file} has pool format {found}, this build reads format {VERSION}; import its scenes again")]
    Version {
        /// Name of the file.
        file: String,
        /// The version that it names.
        found: u32,
    },
    /// The bytes are not those that were written.
    #[error("{file} is damaged at byte {at}: expected {expected}; restore it from a copy or import its scenes again")]
    Damaged {
        /// Name of the file.
        file: String,
        /// Byte offset.
        at: usize,
        /// Content that was expected there.
        expected: String,
    },
    /// A scene of the file breaks a rule that every scene keeps.
    #[error("{file}: scene {scene:?} breaks a rule: {violation}; import its scenes again")]
    Unsound {
        /// Name of the file.
        file: String,
        /// Id of the scene.
        scene: String,
        /// The first rule that it breaks.
        violation: String,
    },
    /// Two scenes have this id.
    #[error("two scenes have the id {0:?}; a pool names each scene once")]
    DuplicateId(String),
    /// Two pools have different scenes under one id.
    #[error(
        "the id {id:?} names two different scenes: {digests} in {first} and {other_digests} in {second}; leave one of them out \
         with `evodrive scenes filter --without {id}`"
    )]
    Clash {
        /// The id.
        id: String,
        /// Pool in which the id was met first.
        first: String,
        /// Its digest there.
        digests: String,
        /// Pool in which the id was met again.
        second: String,
        /// Its digest there.
        other_digests: String,
    },
    /// There are not enough usable scenes for the split.
    #[error(
        "the split asks for {wanted} scenes, but only {usable} of the pool's {all} scenes are usable; ask for fewer or import more"
    )]
    TooFew {
        /// Scenes that the split asks for.
        wanted: usize,
        /// Usable scenes of the pool.
        usable: usize,
        /// All scenes of the pool.
        all: usize,
    },
    /// The share of evolution scenes is not above 0 and at most 1; it holds what was given.
    #[error("the share {0} is out of range; expected more than 0 and at most 1")]
    Share(String),
    /// A part of the split would cut a SafeBench group in two.
    #[error(
        "{part} of {wanted} scenes would split group {group}, but the scenes of a group must stay together; ask for {fits} \
         scenes"
    )]
    CutGroup {
        /// The part, evolution or held-out.
        part: &'static str,
        /// Scenes that the split asks for.
        wanted: usize,
        /// The group that would be cut.
        group: String,
        /// Scenes that fit without cutting it.
        fits: usize,
    },
}

/// The bytes of a pool file.
pub fn encode(pool: &Pool) -> Vec<u8> {
    // One body at a time, so that memory holds the scenes and the final bytes, but no third copy.
    let mut out = Vec::new();
    let mut entries = Vec::with_capacity(pool.scenes.len());
    for scene in &pool.scenes {
        let body = scene_bytes(scene);
        entries.push(entry(scene, body.len()));
        out.extend_from_slice(&body);
    }
    let manifest = Manifest { scenes: entries, left_out: pool.left_out.clone(), provenance: pool.sealed_provenance() };
    let Ok(json) = serde_json::to_vec(&manifest) else {
        unreachable!("a manifest holds texts and counts only, which JSON can always hold")
    };
    let mut head = Vec::with_capacity(HEAD_BYTES + json.len());
    head.extend_from_slice(MAGIC);
    head.extend_from_slice(&VERSION.to_le_bytes());
    head.extend_from_slice(&(json.len() as u64).to_le_bytes());
    head.extend_from_slice(&json);
    out.reserve(head.len() + CHECKSUM_BYTES);
    out.splice(0..0, head);
    let checksum = Digest::of_bytes(&out);
    out.extend_from_slice(checksum.as_bytes());
    out
}

fn entry(scene: &Scene, bytes: usize) -> ManifestEntry {
    ManifestEntry {
        id: scene.id.clone(),
        digest: scene.digest(),
        origin: scene.origin.clone(),
        steps: scene.steps,
        tracks: scene.tracks.len(),
        lanes: scene.road.lanes.len(),
        unusable: usable(scene).err().map(|reason| reason.to_string()),
        bytes,
    }
}

/// The pool in a file's bytes: checksum, manifest, every digest and every rule of a sound scene are checked.
pub fn decode(file_name: &str, bytes: &[u8]) -> Result<Pool, PoolError> {
    let (manifest, mut at) = checked_manifest(file_name, bytes)?;
    let damaged = |at: usize, expected: String| PoolError::Damaged { file: file_name.to_string(), at, expected };
    let end = bytes.len() - CHECKSUM_BYTES;
    let mut pool =
        Pool { scenes: Vec::new(), left_out: manifest.left_out, seals_provenance: manifest.provenance.is_some() };
    for entry in manifest.scenes {
        let body = at.checked_add(entry.bytes).filter(|&to| to <= end).and_then(|to| bytes.get(at..to));
        let body = body.ok_or_else(|| damaged(at, format!("{} bytes of scene {:?}", entry.bytes, entry.id)))?;
        if scene_digest_of(body) != entry.digest {
            return Err(damaged(at, format!("scene {:?} with digest {}", entry.id, entry.digest)));
        }
        let scene = scene_of(body, entry.origin).map_err(|e| damaged(at + e.at, e.expected.to_string()))?;
        if let Some(violation) = scene.validate().first() {
            let violation = violation.to_string();
            return Err(PoolError::Unsound { file: file_name.to_string(), scene: scene.id, violation });
        }
        pool.scenes.push(scene);
        at += entry.bytes;
    }
    if at != end {
        return Err(damaged(at, "the checksum".into()));
    }
    pool.check_ids()?;
    if pool.sealed_provenance() != manifest.provenance {
        return Err(damaged(HEAD_BYTES, "origins and parts left out with the digest `provenance`".into()));
    }
    Ok(pool)
}

/// The manifest in a pool file's bytes, without reading the scenes; the checksum is checked.
pub fn manifest(file_name: &str, bytes: &[u8]) -> Result<Manifest, PoolError> {
    checked_manifest(file_name, bytes).map(|(manifest, _)| manifest)
}

/// The manifest and the place of the first scene.
fn checked_manifest(file_name: &str, bytes: &[u8]) -> Result<(Manifest, usize), PoolError> {
    let file = || file_name.to_string();
    if !bytes.starts_with(MAGIC) {
        return Err(PoolError::NotAPool { file: file(), expected: "the bytes EVODPOOL at its start" });
    }
    let head = bytes.get(8..HEAD_BYTES).and_then(|head| {
        let version = u32::from_le_bytes(*head.first_chunk()?);
        let length = u64::from_le_bytes(*head.get(4..)?.first_chunk()?);
        Some((version, usize::try_from(length).ok()?))
    });
    let damaged = |at: usize, expected: &str| PoolError::Damaged { file: file(), at, expected: expected.into() };
    let (version, length) = head.ok_or_else(|| damaged(8, "a version and the manifest's length"))?;
    if version != VERSION {
        return Err(PoolError::Version { file: file(), found: version });
    }
    let end = bytes.len().checked_sub(CHECKSUM_BYTES).filter(|&end| end >= HEAD_BYTES);
    let end = end.ok_or_else(|| damaged(bytes.len(), "a checksum of 32 bytes at the end"))?;
    if Digest::of_bytes(&bytes[..end]).as_bytes()[..] != bytes[end..] {
        return Err(damaged(end, "the checksum of all bytes before it"));
    }
    let after = HEAD_BYTES.checked_add(length).filter(|&after| after <= end);
    let after = after.ok_or_else(|| damaged(12, "a manifest that ends before the file"))?;
    let manifest = serde_json::from_slice(&bytes[HEAD_BYTES..after])
        .map_err(|error| damaged(HEAD_BYTES, &format!("a manifest as JSON ({error})")))?;
    Ok((manifest, after))
}

/// Number of scenes that evolution sees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EvolutionSize {
    /// A fixed number of scenes.
    Count(usize),
    /// A share of the usable scenes that are not held out, above 0 and at most 1. It gives at least one scene.
    Share(f64),
}

/// A scene of a split: its id, and the digest that its content must have.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SplitScene {
    /// Id of the scene.
    pub id: String,
    /// Digest of its content.
    pub digest: Digest,
}

/// Which scenes evolution uses, and which stay closed until selection is over. A split never changes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Split {
    /// Scenes of evolution, in the order in which the window rotates through them.
    pub evolution: Vec<SplitScene>,
    /// The scenes on which finalists are chosen; none where that is done on those of evolution.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub selection: Vec<SplitScene>,
    /// The scenes that stay closed until selection is over.
    pub held_out: Vec<SplitScene>,
}

impl Split {
    /// All its scenes: those of evolution, those of selection, those held out.
    pub fn all(&self) -> impl Iterator<Item = &SplitScene> {
        self.evolution.iter().chain(&self.selection).chain(&self.held_out)
    }

    /// Digest of the split: of its scenes' ids, digests and order.
    pub fn digest(&self) -> Digest {
        match Digest::of("evodrive/split/1", self) {
            Ok(digest) => digest,
            Err(error) => unreachable!("a split holds texts only: {error}"),
        }
    }
}

impl Pool {
    /// A pool of scenes. Their ids must be unique.
    pub fn new(scenes: Vec<Scene>, left_out: Vec<LeftOut>) -> Result<Pool, PoolError> {
        let pool = Pool { scenes, left_out, seals_provenance: false };
        pool.check_ids()?;
        Ok(pool)
    }

    fn check_ids(&self) -> Result<(), PoolError> {
        let mut ids = BTreeSet::new();
        match self.scenes.iter().find(|scene| !ids.insert(&scene.id)) {
            Some(again) => Err(PoolError::DuplicateId(again.id.clone())),
            None => Ok(()),
        }
    }

    /// Returns the scenes of several pools, each pool given with its name for messages, in their order. A scene that is in several of
    /// them, the same bit for bit, is kept once; the second number counts these repeats.
    ///
    /// # Errors
    /// Two different scenes of one id.
    pub fn merged(pools: Vec<(String, Pool)>) -> Result<(Pool, usize), PoolError> {
        let mut met: BTreeMap<String, (usize, Digest)> = BTreeMap::new();
        let names: Vec<String> = pools.iter().map(|(name, _)| name.clone()).collect();
        let (mut merged, mut repeated) = (Pool::default(), 0);
        for (place, (_, pool)) in pools.into_iter().enumerate() {
            merged.seals_provenance |= pool.seals_provenance;
            for scene in pool.scenes {
                let digest = scene.digest();
                match met.get(&scene.id) {
                    None => {
                        met.insert(scene.id.clone(), (place, digest));
                        merged.scenes.push(scene);
                    }
                    Some((_, known)) if *known == digest => repeated += 1,
                    Some((first, known)) => {
                        let (first, second) = (names[*first].clone(), names[place].clone());
                        let [digests, other_digests] = [known, &digest].map(|digest| digest.short(12));
                        return Err(PoolError::Clash { id: scene.id, first, digests, second, other_digests });
                    }
                }
            }
            let new = pool.left_out.into_iter().filter(|left| !merged.left_out.contains(left)).collect::<Vec<_>>();
            merged.left_out.extend(new);
        }
        Ok((merged, repeated))
    }

    /// Parts the usable scenes of `self` in two: those for which `closed` holds, and the others. Scenes of one
    /// SafeBench group stay together: one of them takes all others along.
    pub fn parted(&self, closed: impl Fn(&Scene) -> bool) -> Split {
        let mut split = Split { evolution: Vec::new(), selection: Vec::new(), held_out: Vec::new() };
        for unit in self.units() {
            let is_closed = unit.scenes.iter().filter_map(|entry| self.scene(&entry.id)).any(&closed);
            if is_closed { split.held_out.extend(unit.scenes) } else { split.evolution.extend(unit.scenes) }
        }
        split
    }

    /// The scenes of a part of a split, in its order.
    pub fn part(&self, part: &[SplitScene]) -> Pool {
        let scenes = part.iter().filter_map(|entry| self.scene(&entry.id).cloned()).collect();
        Pool { scenes, left_out: Vec::new(), seals_provenance: self.seals_provenance }
    }

    /// The scene with this id.
    pub fn scene(&self, id: &str) -> Option<&Scene> {
        self.scenes.iter().find(|scene| scene.id == id)
    }

    /// Digest of the pool: of its scenes' digests sorted by id, so that the order of import does not matter.
    pub fn digest(&self) -> Digest {
        let mut scenes: Vec<(&str, Digest)> = self.scenes.iter().map(|s| (s.id.as_str(), s.digest())).collect();
        scenes.sort();
        match Digest::of("evodrive/pool/1", &scenes) {
            Ok(digest) => digest,
            Err(error) => unreachable!("a list of texts: {error}"),
        }
    }

    /// Digest of the origin of each scene and of the parts left out, where runs seal it.
    pub fn sealed_provenance(&self) -> Option<Digest> {
        if !self.seals_provenance {
            return None;
        }
        let mut origins: Vec<(&str, &Origin)> = self.scenes.iter().map(|s| (s.id.as_str(), &s.origin)).collect();
        origins.sort_by_key(|(id, _)| *id);
        match Digest::of("evodrive/pool-provenance/1", &(origins, &self.left_out)) {
            Ok(digest) => Some(digest),
            Err(error) => unreachable!("lists of texts: {error}"),
        }
    }

    /// Draws `held_out` scenes, then the evolution scenes, from the usable scenes. Their order depends only on the seed
    /// and the ids, so a larger evolution set keeps the same held-out set. Scenes of one SafeBench group (family and
    /// route) stay together; every other scene stands alone.
    pub fn split(&self, seed: Seed, evolution: EvolutionSize, held_out: usize) -> Result<Split, PoolError> {
        self.split_among(seed, evolution, 0, held_out, |_| true)
    }

    /// Splits the scenes whose ids `takes` chooses, with a part for the choice of finalists. A group is there whole or not at all.
    pub fn split_among(
        &self,
        seed: Seed,
        evolution: EvolutionSize,
        selection: usize,
        held_out: usize,
        takes: impl Fn(&str) -> bool,
    ) -> Result<Split, PoolError> {
        let mut units = self.units();
        units.retain(|unit| unit.scenes.iter().all(|scene| takes(&scene.id)));
        seed.stream(&["scene", "split"]).shuffle(&mut units);
        let mut scenes: Vec<SplitScene> = units.iter().flat_map(|unit| unit.scenes.clone()).collect();
        let rest = scenes.len().saturating_sub(held_out).saturating_sub(selection);
        let least = first_whole_after(&units, held_out);
        let wanted = match evolution {
            EvolutionSize::Count(count) => count,
            EvolutionSize::Share(share) if share > 0.0 && share <= 1.0 => {
                let wanted = ((rest as f64 * share) as usize).max(1);
                whole_groups(&units, held_out + wanted)
                    .0
                    .checked_sub(held_out)
                    .filter(|n| *n > 0)
                    .or(least)
                    .unwrap_or(wanted)
            }
            EvolutionSize::Share(share) => return Err(PoolError::Share(share.to_string())),
        };
        if wanted > rest || held_out > scenes.len() {
            let wanted = wanted.saturating_add(held_out).saturating_add(selection);
            return Err(PoolError::TooFew { wanted, usable: scenes.len(), all: self.scenes.len() });
        }
        if let (fits, Some(group)) = whole_groups(&units, held_out) {
            return Err(PoolError::CutGroup { part: "a held-out set", wanted: held_out, group, fits });
        }
        if let (all, Some(group)) = whole_groups(&units, held_out + wanted) {
            let fits = Some(all - held_out).filter(|fits| *fits > 0).or(least).unwrap_or(0);
            return Err(PoolError::CutGroup { part: "an evolution set", wanted, group, fits });
        }
        if let (all, Some(group)) = whole_groups(&units, held_out + wanted + selection) {
            let fits = all.saturating_sub(held_out + wanted);
            return Err(PoolError::CutGroup { part: "a selection set", wanted: selection, group, fits });
        }
        let mut evolution = scenes.split_off(held_out);
        let mut chosen_on = evolution.split_off(wanted);
        chosen_on.truncate(selection);
        Ok(Split { evolution, selection: chosen_on, held_out: scenes })
    }

    /// The usable scenes in units that stay together, sorted by the first id of each unit.
    fn units(&self) -> Vec<Unit> {
        let mut units: BTreeMap<String, Vec<SplitScene>> = BTreeMap::new();
        let group = |scene: &Scene| scene.staging.as_ref().map_or_else(|| scene.id.clone(), |staging| staging.group());
        for scene in self.scenes.iter().filter(|scene| usable(scene).is_ok()) {
            let scenes = units.entry(group(scene)).or_default();
            scenes.push(SplitScene { id: scene.id.clone(), digest: scene.digest() });
        }
        let mut units: Vec<Unit> = units.into_iter().map(|(group, scenes)| Unit { group, scenes }).collect();
        units.iter_mut().for_each(|unit| unit.scenes.sort_by(|a, b| a.id.cmp(&b.id)));
        units.sort_by(|a, b| a.scenes[0].id.cmp(&b.scenes[0].id));
        units
    }
}

/// Scenes that a split keeps together.
struct Unit {
    group: String,
    /// At least one.
    scenes: Vec<SplitScene>,
}

/// Returns how many of the first `wanted` scenes form whole units, and the unit that would be cut.
fn whole_groups(units: &[Unit], wanted: usize) -> (usize, Option<String>) {
    let mut fits = 0;
    for unit in units {
        if fits + unit.scenes.len() > wanted {
            return (fits, (fits < wanted).then(|| unit.group.clone()));
        }
        fits += unit.scenes.len();
    }
    (fits, None)
}

/// The smallest number of scenes that whole units after the first `held_out` scenes can have.
fn first_whole_after(units: &[Unit], held_out: usize) -> Option<usize> {
    let mut count = 0;
    units.iter().find_map(|unit| {
        count += unit.scenes.len();
        count.checked_sub(held_out).filter(|least| *least > 0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::fixture::two_lane_scene;

    fn pool(count: usize) -> Pool {
        let scenes = (0..count).map(|k| Scene { id: format!("s{k:02}"), ..two_lane_scene() }).collect();
        let left_out = LeftOut { file: "a.xml".into(), what: "obstacle 7".into(), reason: "it has no shape".into() };
        Pool::new(scenes, vec![left_out]).unwrap()
    }

    #[test]
    fn a_pool_comes_back_from_its_bytes() {
        let pool = pool(3);
        let bytes = encode(&pool);
        assert_eq!(decode("p.pool", &bytes), Ok(pool.clone()));
        let manifest = manifest("p.pool", &bytes).unwrap();
        assert_eq!(manifest.scenes[1].digest, pool.scenes[1].digest());
        assert_eq!((manifest.scenes[1].tracks, manifest.scenes[1].unusable.clone()), (2, None));
    }

    #[test]
    fn where_scenes_came_from_has_a_digest_only_where_runs_seal_it() {
        let old = pool(3);
        assert_eq!(manifest("p.pool", &encode(&old)).unwrap().provenance, None);
        let new = Pool { seals_provenance: true, ..pool(3) };
        let digest = new.sealed_provenance();
        assert_eq!((decode("p.pool", &encode(&new)), new.digest()), (Ok(new.clone()), old.digest()));
        let mut other = new.clone();
        other.scenes[1].origin.name = "another file".into();
        assert_ne!(other.sealed_provenance(), digest);
        let mut fewer = new.clone();
        fewer.left_out.clear();
        assert_ne!(fewer.sealed_provenance(), digest);
        let mut turned = new.clone();
        turned.scenes.reverse();
        assert_eq!(turned.sealed_provenance(), digest);
        let (merged, _) = Pool::merged(vec![("old".into(), old), ("new".into(), new)]).unwrap();
        assert!(merged.seals_provenance && merged.part(&[]).seals_provenance);
    }

    #[test]
    fn a_flipped_byte_anywhere_is_found() {
        let bytes = encode(&pool(1));
        for at in (0..bytes.len()).step_by(97) {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x10;
            assert!(decode("p.pool", &damaged).is_err(), "{at}");
        }
    }

    #[test]
    fn a_truncated_pool_is_refused() {
        let bytes = encode(&pool(1));
        for end in [0, 7, 8, 15, 20, 60, bytes.len() / 2, bytes.len() - 1] {
            assert!(decode("p.pool", &bytes[..end]).is_err(), "{end}");
        }
    }

    #[test]
    fn a_well_sealed_lie_is_refused() {
        let sealed = |change: fn(&mut Vec<u8>)| {
            let mut bytes = encode(&pool(1));
            bytes.truncate(bytes.len() - CHECKSUM_BYTES);
            change(&mut bytes);
            let checksum = Digest::of_bytes(&bytes);
            bytes.extend_from_slice(checksum.as_bytes());
            decode("p.pool", &bytes)
        };
        assert!(matches!(sealed(|b| b[12..20].fill(0xff)), Err(PoolError::Damaged { at: 12, .. })));
        assert!(matches!(sealed(|b| b[8] = 9), Err(PoolError::Version { found: 9, .. })));
        assert!(matches!(sealed(|b| b.truncate(b.len() - 5)), Err(PoolError::Damaged { .. })));
        assert!(matches!(sealed(|b| b.push(0)), Err(PoolError::Damaged { .. })));
        assert!(sealed(|_| ()).is_ok());
    }

    #[test]
    fn two_scenes_of_one_id_are_no_pool() {
        let twice = Pool::new(vec![two_lane_scene(), two_lane_scene()], vec![]);
        assert_eq!(twice, Err(PoolError::DuplicateId("fixture".into())));
    }

    #[test]
    fn a_split_rests_on_seed_and_ids_and_keeps_its_parts_apart() {
        let pool = pool(12);
        let mut turned = pool.clone();
        turned.scenes.reverse();
        let split = pool.split(Seed(4), EvolutionSize::Count(7), 3).unwrap();
        assert_eq!(split, turned.split(Seed(4), EvolutionSize::Count(7), 3).unwrap());
        assert_ne!(split.digest(), pool.split(Seed(5), EvolutionSize::Count(7), 3).unwrap().digest());
        assert_eq!(split.held_out, pool.split(Seed(4), EvolutionSize::Share(1.0), 3).unwrap().held_out);
        assert_eq!(split.all().map(|s| s.id.as_str()).collect::<BTreeSet<&str>>().len(), 10);
        // A part for selection takes nothing from the two others.
        let apart = pool.split_among(Seed(4), EvolutionSize::Count(7), 2, 3, |_| true).unwrap();
        assert_eq!((&apart.evolution, &apart.held_out, apart.selection.len()), (&split.evolution, &split.held_out, 2));
        assert_eq!(apart.all().map(|s| s.id.as_str()).collect::<BTreeSet<&str>>().len(), 12);
        assert_ne!(apart.digest(), split.digest());
        let few = pool.split_among(Seed(4), EvolutionSize::Count(7), 3, 3, |_| true);
        assert!(matches!(few, Err(PoolError::TooFew { wanted: 13, usable: 12, .. })), "{few:?}");
    }

    #[test]
    fn scenes_of_one_group_are_never_split_apart() {
        use crate::synth::{FamilyOptions, family_member};
        let options = FamilyOptions { draws: 3, ..FamilyOptions::all() };
        let scenes = (0..options.count()).map(|i| family_member(&options, Seed(7), i).unwrap()).collect();
        let pool = Pool::new(scenes, vec![]).unwrap();
        let groups = |scenes: &[SplitScene]| -> BTreeSet<String> {
            scenes.iter().map(|s| pool.scene(&s.id).unwrap().staging.as_ref().unwrap().group()).collect()
        };
        let split = pool.split(Seed(4), EvolutionSize::Count(120), 30).unwrap();
        let (open, closed) = (groups(&split.evolution), groups(&split.held_out));
        assert_eq!((open.len(), closed.len()), (40, 10));
        assert!(open.is_disjoint(&closed));
        // Where one scene of a group is not taken, no scene of it is.
        let first = &split.evolution[0].id;
        let rest = pool.split_among(Seed(4), EvolutionSize::Share(1.0), 0, 30, |id| id != first).unwrap();
        let without = groups(&[rest.evolution, rest.held_out].concat());
        let own = pool.scene(first).unwrap().staging.as_ref().unwrap().group();
        assert!(!without.contains(&own) && without.len() == 79, "{}", without.len());
        let cut = pool.split(Seed(4), EvolutionSize::Count(120), 31).unwrap_err();
        assert!(matches!(&cut, PoolError::CutGroup { wanted: 31, fits: 30, .. }), "{cut}");
        let cut = pool.split(Seed(4), EvolutionSize::Count(121), 30).unwrap_err();
        assert!(matches!(&cut, PoolError::CutGroup { wanted: 121, fits: 120, .. }), "of the evolution set: {cut}");
        let cut = pool.split(Seed(4), EvolutionSize::Count(2), 30).unwrap_err();
        assert!(matches!(&cut, PoolError::CutGroup { wanted: 2, fits: 3, .. }), "no set of no scenes: {cut}");
        assert_eq!(pool.split(Seed(4), EvolutionSize::Share(0.001), 30).unwrap().evolution.len(), 3, "a whole group");
        assert_eq!(pool.split(Seed(4), EvolutionSize::Share(0.335), 30).unwrap().evolution.len(), 69, "70 cut a group");
        // With one draw a route, each group is one scene, so groups and scenes are split alike.
        let one =
            Pool::new((0..80).map(|i| family_member(&FamilyOptions::all(), Seed(7), i).unwrap()).collect(), vec![]);
        assert_eq!(groups(&one.unwrap().split(Seed(4), EvolutionSize::Count(40), 10).unwrap().held_out), closed);
    }

    #[test]
    fn pools_are_merged_by_id_and_content() {
        let [one, two] = [pool(3), pool(5)];
        let named =
            |pools: &[(&str, &Pool)]| pools.iter().map(|(name, pool)| (name.to_string(), (*pool).clone())).collect();
        let (merged, repeated) = Pool::merged(named(&[("one", &one), ("two", &two)])).unwrap();
        assert_eq!((merged.digest(), repeated, merged.left_out.len()), (two.digest(), 3, 1));
        let mut other = pool(1);
        other.scenes[0].current_step += 1;
        let clash = Pool::merged(named(&[("one", &one), ("other", &other)])).unwrap_err();
        assert!(
            matches!(&clash, PoolError::Clash { id, first, second, .. } if id == "s00" && first == "one" && second == "other")
        );
        assert_ne!(one.scenes[0].digest(), other.scenes[0].digest());
    }

    #[test]
    fn a_pool_parted_by_a_rule_loses_no_usable_scene_and_keeps_groups_whole() {
        use crate::synth::{FamilyOptions, family_member};
        let options = FamilyOptions { draws: 2, ..FamilyOptions::all() };
        let pool = Pool::new((0..12).map(|i| family_member(&options, Seed(7), i).unwrap()).collect(), vec![]).unwrap();
        let marked = pool.scenes[3].id.clone();
        let split = pool.parted(|scene| scene.id == marked);
        let group = pool.scenes[3].staging.as_ref().unwrap().group();
        let closed = pool.part(&split.held_out);
        assert!(closed.scenes.iter().all(|scene| scene.staging.as_ref().unwrap().group() == group));
        assert_eq!((closed.scenes.len(), pool.part(&split.evolution).scenes.len()), (2, 10));
    }

    #[test]
    fn a_split_larger_than_the_pool_is_refused() {
        let refused = pool(4).split(Seed(1), EvolutionSize::Count(3), 2);
        assert_eq!(refused, Err(PoolError::TooFew { wanted: 5, usable: 4, all: 4 }));
        assert!(pool(4).split(Seed(1), EvolutionSize::Share(0.0), 2).is_err());
        assert!(pool(4).split(Seed(1), EvolutionSize::Count(1), 5).is_err());
    }
}
