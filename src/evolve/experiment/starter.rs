//! The first experiment file of a user: short, commented, on one of the shipped protocols.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::key::Range;
use super::place::{PUBLISHED, STAGED};
use super::{ExperimentError, OptionError, PlannerFile};
use crate::families;
use crate::objects::FamilyName;
use crate::scene::{Pool, usable};
use crate::stage::Source;
use crate::text::counted;

/// Choices that a new experiment file is written for.
#[derive(Clone, Debug)]
pub struct Starter {
    /// Names the experiment and its cassette.
    pub name: String,
    /// Each becomes a lineage; of one protocol.
    pub families: Vec<String>,
    /// All families of their protocol in place of these.
    pub all: bool,
    /// The scenes as the file names them, with what they hold; generated ones without.
    pub scenes: Option<(PathBuf, Pool)>,
    /// A program file from which the lineage starts, in place of its family's published parent.
    pub start: Option<PathBuf>,
    /// The planner that is the ego; IDM without.
    pub driver: Option<PlannerFile>,
    /// `idm`, `pdm`, `frenet`, or `learned` for the protocol's learned ego; a driver takes its place.
    pub ego: String,
    pub epochs: Option<i64>,
    pub slots: Option<i64>,
    /// Scenes that stay closed until evolution is over.
    pub held_out: Option<usize>,
}

/// Scenes of a small generated study.
const GENERATED: usize = 60;
/// Held-out scenes, where there are twice as many scenes. With fewer an attack rate says little.
const HELD_OUT_MIN: usize = 20;
/// Scenes on which finalists are chosen, where at least as many are left for the search.
const SELECTION: usize = 300;
/// Most scenes of a window.
const WINDOW_MAX: usize = 20;

/// The file, and what its user is to know of it at once.
#[derive(Clone, Debug)]
pub struct Started {
    /// The text of the file.
    pub text: String,
    /// Sentence on what so many held-out scenes can show of a rate.
    pub shows: String,
    /// Sentence on what they cannot show, where they are few.
    pub few: Option<String>,
}

/// The text of the file, with what its scenes can show.
///
/// # Errors
/// An unknown family, families of two protocols, a name that no run folder can have, too few usable scenes, a number out of its range.
pub fn starter(starter: &Starter) -> Result<Started, ExperimentError> {
    let option = |error| ExperimentError::Option { file: "init".into(), error };
    let families = chosen(starter).map_err(option)?;
    let name = toml::Value::String(starter.name.clone());
    Range::Name.check("NAME", &name).map_err(option)?;
    for (name, count) in [("--epochs", starter.epochs), ("--slots", starter.slots)] {
        count.map_or(Ok(()), |count| Range::Whole(1, 1000).check(name, &count.into())).map_err(option)?;
    }
    let names: Vec<String> = families.iter().map(|of| of.contract.family.to_string()).collect();
    let staged = families.iter().any(|of| of.contract.backend == STAGED);
    if staged && starter.driver.is_some() {
        let expected =
            "a family for recorded traffic (`evodrive families`); SafeBench's protocol does not take planners";
        let found = format!("given beside --family {}", names.join(","));
        return Err(option(OptionError::new("--driver", found, expected)));
    }
    let (ego, suffix, against) = match &starter.driver {
        Some(_) => ("command", "mine", "a planner of one's own"),
        None if starter.ego == "learned" => ("learned", "sac", "a learned ego"),
        None if starter.ego == "pdm" => ("pdm", "pdm", "the PDM-Closed ego"),
        None if starter.ego == "frenet" => ("frenet", "frenet", "the Frenet ego"),
        None => ("idm", "idm", "the IDM ego"),
    };
    let protocol = if staged { STAGED } else { "metadrive-2" };
    let mut text = format!(
        "# An experiment of your own. Keys that are not here come from its base; docs/EXPERIMENT.md lists every key.\n\
         base = \"evodrive:{protocol}\"\nname = \"{name}\"\n\
         describes = \"{families} evolved against {against}\"\n\
         cassette = \"{name}.jsonl\"   # recorded answers: `evodrive record {name}.toml` writes them\n",
        families = names.join(", "),
        name = starter.name
    );
    if families.iter().any(|of| of.asks.counsel.is_some()) {
        text.push_str(
            "counsel = { rounds = 3, vehicles = 8 }   # sets of attackers tried in a scene, vehicles shown\n",
        );
        text.push_str("roles.attacker_agent = \"scripted\"\n");
    }
    if families.iter().any(|of| of.asks.templates.is_some()) {
        text.push_str("# [composition] can describe scenarios in words; without it the published templates stay.\n");
    }
    let (scenes, held_out) = scenes(starter, staged)?;
    text.push_str(&scenes);
    let (epochs, slots) = (starter.epochs.unwrap_or(4), starter.slots.unwrap_or(6));
    let _ = write!(text, "\n[budget]\nepochs = {epochs}\nslots = {slots}   # parallel proposals of an epoch\n");
    for name in &names {
        let _ = write!(text, "\n[[lineage]]\nid = \"{name}-{suffix}\"\nfamily = \"{name}\"\nego = \"{ego}\"\n");
        if ego == "learned" {
            let policy = if staged { PUBLISHED } else { "evodrive:sac-metadrive" };
            let _ = writeln!(text, "policy = \"{policy}\"   # docs/EGOS.md; or weights of your own");
        }
        if let Some(start) = &starter.start {
            let named = toml::Value::String(start.to_string_lossy().into_owned());
            let _ = writeln!(text, "parent_program = {named}   # evolution starts from it");
        }
    }
    text.push_str(MODEL);
    if let Some(driver) = &starter.driver {
        let list = |words: &[String]| toml::Value::from(words.to_vec());
        let _ = write!(
            text,
            "\n[driver]   # docs/EGOS.md, \"A planner of your own\"\ncommand = {}   # started in the folder of this file\n\
             files = {}   # its identity: add every file whose change would change a decision\n\
             cassette = \"{}.rollouts.jsonl.zst\"   # its recorded rollouts\n",
            list(&driver.command),
            list(&driver.files),
            starter.name
        );
    }
    Ok(Started { text, shows: shows(held_out), few: few(held_out) })
}

/// How a model of the user's is named; nothing of it holds before the marks are taken off.
const MODEL: &str = "\n# A language model of your own in place of the rules that answer every role (docs/MODELS.md has the other kinds):\n\
    # [roles]\n# actor = \"mine\"\n# repair = \"mine\"\n# [models.mine]\n# kind = \"command\"\n# model = \"mine-1\"\n\
    # provenance = \"my_model.py\"\n# unwrap = true   # takes code fences, think blocks and the like off around a reply\n\
    # command = { program = [\"python3\", \"my_model.py\"], timeout_s = 600 }\n";

/// The families that are named, in their order, or all of their protocol by name.
fn chosen(starter: &Starter) -> Result<Vec<Source>, OptionError> {
    let sources = families::sources();
    let known: Vec<String> = sources.iter().map(|family| family.contract.family.to_string()).collect();
    let mut named: Vec<Source> = Vec::new();
    for name in &starter.families {
        let family = FamilyName::new(name.as_str());
        if named.iter().any(|of| of.contract.family == family) {
            return Err(OptionError::new("--family", format!("{name:?} twice"), "each family once"));
        }
        named.push(sources.get(&family).cloned().ok_or_else(|| OptionError::word("--family", name, &known))?);
    }
    let protocol = |of: &Source| of.contract.backend.clone();
    let Some(first) = named.first().map(protocol) else {
        return Err(OptionError::new("--family", "empty", "the name of a family"));
    };
    if let Some(other) = named.iter().find(|of| protocol(of) != first) {
        let found = format!("{} beside {}", other.contract.family, named[0].contract.family);
        let expected =
            "families of one protocol (`evodrive families` says which is whose); write a file for each protocol";
        return Err(OptionError::new("--family", found, expected));
    }
    Ok(if starter.all { sources.iter().filter(|of| protocol(of) == first).cloned().collect() } else { named })
}

/// `[scenes]` and `[split]`: a fifth of the scenes is held out, and 20 at least where half of them are so many. A window sees at most 20
/// of the others.
fn scenes(starter: &Starter, staged: bool) -> Result<(String, usize), ExperimentError> {
    let (source, count) = match &starter.scenes {
        None if staged => return generated_groups(starter),
        None => (format!("count = {GENERATED}   # generated; `evodrive init --scenes` takes yours"), GENERATED),
        Some((path, pool)) => (named_source(path), usable_in(path, pool, staged)?),
    };
    let held_out = match starter.held_out {
        None => (count / 5).max(HELD_OUT_MIN.min(count / 2)),
        Some(wanted) => held_out_of(count, wanted)?,
    };
    let rest = count - held_out;
    let window = rest.min(WINDOW_MAX);
    let selection = if staged {
        String::new()
    } else if rest > 2 * SELECTION {
        format!("selection = {SELECTION}   # finalists are chosen on these, which no step of the search sees\n")
    } else {
        "selection = 0   # of many scenes some 300: finalists are then chosen on what no step of the search sees\n"
            .into()
    };
    let shows = shows(held_out);
    let text = format!(
        "\n[scenes]\n{source}\n\n[split]\nevolution = {{ share = 1.0 }}   # of the usable scenes that are not held out\n\
         held_out = {held_out}   # {shows}\nwindow = {window}   # scenes of an epoch\n{selection}"
    );
    Ok((text, held_out))
}

pub(super) fn named_source(path: &Path) -> String {
    let named = toml::Value::String(path.to_string_lossy().into_owned());
    if named.as_str().is_some_and(|path| path.ends_with(".pool")) {
        format!("source = \"pool\"\npath = {named}")
    } else {
        format!("source = \"files\"\npaths = [{named}]")
    }
}

/// Returns how many scenes of a pool the families can use.
pub(super) fn usable_in(path: &Path, pool: &Pool, staged: bool) -> Result<usize, ExperimentError> {
    let (path, all) = (path.display(), pool.scenes.len());
    if let Some(strange) = pool.scenes.iter().find(|scene| scene.staging.is_some() != staged) {
        let (is, want) = if staged {
            ("recorded or generated traffic", "scenes that are staged for SafeBench")
        } else {
            ("staged for a traffic family of SafeBench", "recorded or generated traffic")
        };
        return Err(ExperimentError::Scenes(format!(
            "{path}: scene {} is {is}, and the families play {want}; name other families by --family (`evodrive families`) or other \
             scenes",
            strange.id
        )));
    }
    let count = pool.scenes.iter().filter(|scene| usable(scene).is_ok()).count();
    if count < 2 {
        return Err(ExperimentError::Scenes(format!(
            "{count} of the {all} scenes of {path} can be used; evolution needs at least 2, one of them held out (`evodrive scenes check` says why)"
        )));
    }
    Ok(count)
}

fn held_out_of(count: usize, wanted: usize) -> Result<usize, ExperimentError> {
    let error =
        OptionError::new("--held-out", wanted, format!("1 to {}: {} can be used", count - 1, counted(count, "scene")));
    let fits = (1..count).contains(&wanted);
    if fits { Ok(wanted) } else { Err(ExperimentError::Option { file: "init".into(), error }) }
}

/// Says what so many held-out scenes can show of a rate: the 95 % interval of one half is the widest.
fn shows(held_out: usize) -> String {
    let few = if held_out < HELD_OUT_MIN { "few: " } else { "" };
    let scenes = counted(held_out, "scene");
    match 98.0 / (held_out as f64).sqrt() {
        // Half a width of all there is: whatever is measured, the rate may be any.
        points if points >= 50.0 => format!("{few}a rate over {scenes} says nearly nothing"),
        points => format!("{few}a rate over {scenes} is known to within {} percentage points (95 %)", points.ceil()),
    }
}

/// Says what fewer than [`HELD_OUT_MIN`] held-out scenes are good for, and what not.
fn few(held_out: usize) -> Option<String> {
    (held_out < HELD_OUT_MIN).then(|| {
        format!(
            "{} can show that everything works, and how a program makes the ego fail. Which of two programs or planners is \
             better so few cannot show: for that hold out {HELD_OUT_MIN} or more, of more scenes (`evodrive scenes import`, or \
             `init` without --scenes, which generates {GENERATED})",
            counted(held_out, "held-out scene")
        )
    })
}

/// Two routes of each traffic family: whole groups on both sides of the split, of 4 scenes each.
fn generated_groups(starter: &Starter) -> Result<(String, usize), ExperimentError> {
    let count = 64;
    let held_out = starter.held_out.map_or(Ok(24), |wanted| held_out_of(count, wanted))?;
    if held_out % 4 != 0 {
        let expected = "a multiple of 4: whole groups of a traffic family and a route are held out";
        let error = OptionError::new("--held-out", held_out, expected);
        return Err(ExperimentError::Option { file: "init".into(), error });
    }
    let (evolution, shows) = (count - held_out, shows(held_out));
    let text = format!(
        "\n[scenes.options]\nroutes = [4, 5]   # of 4 to 13, in each of eight traffic families\n\n[split]\n\
         evolution = {{ count = {evolution} }}   # whole groups of a family and a route, 4 scenes each\nheld_out = {held_out}   # {shows}\n\
         window = {evolution}\n"
    );
    Ok((text, held_out))
}
